"""What `gantrytau calibrate --example` prints: the file of a cell, to be filled in, for each kind of robot."""

from gantrytau import did_you_mean
from gantrytau.commands.calibrate.cell_template import CELL, F1, L1, SIX
from gantrytau.commands.printing.reporting import CommandError

EXAMPLES = {"l1": L1, "six": SIX, "f1": F1}
OF_MODELS = {"GantryTau": "l1", "SixLinkGantryTau": "six", "F1GantryTau": "f1"}


def example(kind: str | None, robot: str | None) -> str:
    """The cell of a kind of robot, or of a model of that kind; CommandError for another."""
    if kind is not None and kind.lower() not in EXAMPLES:
        raise CommandError(
            f"--example {kind}: there is no such example{did_you_mean(kind.lower(), EXAMPLES)}"
        )
    if robot is None:
        return CELL.format(**EXAMPLES[(kind or "l1").lower()])
    name = robot.partition("(")[0]
    known = EXAMPLES[kind.lower()] if kind else EXAMPLES[OF_MODELS.get(name, "l1")]
    if kind is None and name not in OF_MODELS:
        raise CommandError(
            f"--example --robot {robot}: expected {', '.join(OF_MODELS)}, or a kind beside it, as --example six, for "
            "limits, device and home to begin with"
        )
    named = f'model = "{robot}"'
    # limits, device and home of the example are those of its own robot
    warning = "" if named in known["robot"] else OTHERS.format(known["robot"].split('"')[1])
    return warning + CELL.format(**(known | {"robot": named.ljust(27)}))


OTHERS = "# Limits, device and home below fit {}: make them those of your robot.\n"
EXAMPLE = example("l1", None)
