"""What is known in a sample, side by side in one vector: state, parameters, what is measured, references, answers."""

from collections.abc import Mapping
from typing import Any, Literal, get_args

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau_fmu.controller.channels import Channel, Declaration, Values

State = Literal["idle", "submit", "obtain"]
STATES: tuple[str, ...] = get_args(State)
ACTIVATE = Channel("f_activate", "1", minimum=0.0, maximum=1.0)


class Board:
    """Values by name. published: what clients are given, the first `published.size` numbers; declaration: all of them,
    with the answers of clients as `client.channel`.

    Raises ModelError where two have one name.
    """

    def __init__(self, groups: Mapping[str, Declaration], answers: Mapping[str, Declaration]):
        state = Channel("state", "1", minimum=0.0, maximum=len(STATES) - 1.0)
        owners = {"state": "the controller"}
        for owner, group in groups.items():
            for name in group.names:
                if name in owners:
                    raise ModelError(
                        f"controller: found '{name}' in {owners[name]} and in {owner}, expected each name once; rename one"
                    )
                owners[name] = owner
        self.published = Declaration([state, *(channel for group in groups.values() for channel in group)])
        sent = [
            Channel(f"{owner}.{c.name}", c.unit, c.size, c.minimum, c.maximum)
            for owner, declaration in answers.items()
            for c in declaration
        ]
        self.declaration = Declaration([*self.published, *sent])
        self.values = np.zeros(self.declaration.size)
        self._places: dict[str, slice] = {}
        start = 1
        for owner, group in (*groups.items(), *answers.items()):
            self._places[owner] = slice(start, start + group.size)
            start += group.size

    def put(self, owner: str, values: Values) -> None:
        """The values of one group, or of the answers of one client."""
        self.values[self._places[owner]] = values

    def of(self, owner: str) -> Values:
        """The values of one group, a view."""
        return self.values[self._places[owner]]

    def by_name(self) -> dict[str, Any]:
        """All values: floats, and vectors (size,), copies that their taker may change."""
        kept = self.values.copy()
        return {
            channel.name: float(kept[place.start]) if channel.size == 1 else kept[place]
            for channel, place in zip(self.declaration, self.declaration.slices.values(), strict=True)
        }
