"""A predictive controller as a component of models, sampled once in its period."""

import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from gantrytau import Input, Model, ModelError, Output, Real, sampled
from gantrytau.border.refusal import did_you_mean
from gantrytau.language.events import by_law
from gantrytau.simulation.to_result import labels
from gantrytau_optimica.predictive.plan import Status

STATUSES = get_args(Status)
PAST = 2  # steps of which the memory is kept: an instant may be asked again


class MpcBlock(Model):
    """A controller between connectors: what it measures are inputs, what it gives outputs, held from sample to sample.

    The port of `pole.p` is `p`, of `robot.carts[0].f` `carts_0_f`: the name without its first word, where no other has it,
    what is no letter or digit as `_`. step: samples until now; status: of the last one, its place in STATUSES.
    """

    period: float
    joined: tuple[str, ...]  # states and inputs
    ports: Mapping[str, str]  # name of a state, estimate or input of the problem -> its port

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...  # ports, by the problem

    def __getitem__(self, name: str) -> Any:
        """The port of a name of the controller's problem."""
        if name not in self.ports:
            words = f"found no port for '{name}', expected one of {', '.join(self.ports)}{did_you_mean(name, self.ports)}"
            raise ModelError(words, place=type(self).__name__)
        return getattr(self, self.ports[name])

    def wired(self, **plants: Any) -> Iterator[Any]:
        """Equations that join all ports but those of estimates with components by their names: `wired(pole=self.pole)`.

        ModelError for a port whose name begins with no such component, or is nothing in it.
        """
        for name in self.joined:
            yield self[name] == self._there(name, plants)

    def _there(self, name: str, plants: Mapping[str, Any]) -> Any:
        first, *rest = re.findall(r"[^.\[\]]+", name)
        try:
            found = plants[first]
            for part in rest:
                found = found[int(part)] if part.isdigit() else getattr(found, part)
        except (KeyError, AttributeError, IndexError, TypeError) as error:
            words = f"found no {name} among {', '.join(plants) or 'no components'}; give {first}=component, or join "
            raise ModelError(f"{words}the port {self.ports[name]} by an equation", place="wired") from error
        return found


def mpc_block(mpc: Any) -> MpcBlock:
    """A component of an Mpc."""
    read, given, found = mpc.built.read.dae, (*mpc.states, *mpc.estimated), mpc.inputs
    ports, units = _ports((*given, *found)), labels(read)[0]
    members: dict[str, Any] = {
        ports[n]: Input(unit=units.get(n), description=f"{n}, measured") for n in given
    }
    members |= {ports[n]: Output(unit=units.get(n), description=n, start=0.0) for n in found}
    members |= {f"seen_{k}": Real(description=f"{n} at the last sample") for k, n in enumerate(given)}
    members["step"] = Real(unit="1", description="samples until now", start=0.0)
    members["status"] = Real(
        unit="1", description=f"of the last sample, one of {', '.join(STATUSES)}", start=0.0
    )
    law = _NumberedSteps(mpc, given)

    def equations(self: MpcBlock) -> Iterator[Any]:
        seen = [getattr(self, f"seen_{k}") for k in range(len(given))]
        for name, one in zip(given, seen, strict=True):
            yield sampled(one, self[name], period=self.period)
        outputs = [*(self[name] for name in found), self.status]
        for one in outputs:
            yield sampled(one, one, period=self.period)
        yield sampled(self.step, self.step + 1, period=self.period)
        yield by_law(outputs, law, [self.step, *seen])

    about = {"period": mpc.period, "ports": ports, "joined": (*mpc.states, *found), "__doc__": f"{mpc!r}"}
    own = {**members, **about, "equations": equations, "__module__": __name__}
    kind = type(f"{mpc.name}Mpc", (MpcBlock,), own)
    return kind()


class _NumberedSteps:
    """The steps of a controller by number. A step that is asked for again gives the same answer."""

    def __init__(self, mpc: Any, names: tuple[str, ...]):
        self._mpc, self._names = mpc, names
        self._before: dict[int, Any] = {}  # number of a step -> memory of the controller before it

    def __call__(self, t: float, given: np.ndarray) -> list[float]:
        mpc, number = self._mpc, round(given[0])
        memory = self._before.get(number) if number > 1 else None
        mpc.recall(memory)
        waiting = list(mpc.held.values())
        found = list(mpc.step(dict(zip(self._names, given[1:].tolist(), strict=True)), t).values())
        self._before = {k: m for k, m in self._before.items() if number - PAST < k <= number}
        self._before[number + 1] = mpc.memory
        return [*(waiting if mpc.delay else found), STATUSES.index(mpc.status)]


def _ports(names: tuple[str, ...]) -> dict[str, str]:
    """Attributes for names."""
    taken = {"period", "ports", "joined", "wired", "equations", "step", "status", "time"}

    def plain(name: str) -> str:
        return re.sub(r"\W+", "_", name).strip("_")

    short = {name: plain(name.partition(".")[2] or name) for name in names}
    counts = list(short.values())
    return {
        name: one if counts.count(one) == 1 and one not in taken and not hasattr(Model, one) else plain(name)
        for name, one in short.items()
    }
