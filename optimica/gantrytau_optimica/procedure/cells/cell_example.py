"""The file of a cell as an example to be filled in, for each kind of robot."""

from gantrytau import ModelError, did_you_mean
from gantrytau.border.refusal import Given

CELL = """\
# A robot cell to be calibrated. Make this file your own, then: gantrytau calibrate cell.toml
# Numbers are in SI, m and rad; a text may bring another unit, as "5 mm" or "40 deg". Positions are in the world.

[robot]
{robot} # as the other commands name it; a class of your own: "robot.py:Robot"
tape = "{tape}"               # standard deviation of the tape measure, from which values below are known

[values]                    # what the tape measure says, by the names of the model; all else is the model's own
# {value}

[goal]
error = "{error}"            # of the tool, in the mean over the workspace, to be reached after calibration
poses = {poses}                  # to be measured

[limits]
strokes = {strokes} # of all carts, or one pair for each, as the controller shows them{turntables}
ball_joint = "{ball_joint}"       # largest angle of a link from the axis of its joint
link_radius = "{link_radius}"
stroke_margin = "20 mm"     # what must be left of each limit, for safety
angle_margin = "3 deg"
clearance = "{clearance}"         # between links or plate and anything else

[[limits.obstacles]]        # as many as there are, or none
kind = "box"                # or "cylinder" and "capsule" with start, end, radius
low = {low}
high = {high}

[[limits.plate]]            # capsules that stand for plate and tool, in the frame of the tool
start = [0.0, 0.0, 0.0]
end = {plate_end}
radius = "{plate_radius}"

[device]                    # kind = "laser tracker", "T-Mac", "single camera" or "stereo cameras"
{device}        # where it stands, roughly
frame = "fitted"            # measurements in its own frame, or any; "base": in that of the robot, where it is commanded
target = [0.05, 0.0, 0.0]   # what it measures, in the frame of the tool
{facing}

[plan]
robots = 20                 # simulated ones, with errors as the tape measure leaves them; all must be safe in all poses
{home}    # actuators at begin and end; left out: the start of the model

[program]                   # of the robot, in RAPID
name = "Calibration"
speed = "100 mm/s"
settle = 1.0                # s, until the tool stands still
carts = "robax"             # or "extax"
trigger = "operator"        # waits for a key on the pendant; "TPWrite": tells and goes on; or the name of a digital output
# measure = 2.0             # s at each pose, where the program goes on by itself
# tool = "tool0"            # its tool data
"""

L1 = dict(
    robot='model = "GantryTau(L1)"    ',
    tape="5 mm",
    value='"arms[0].length" = 2.061\n# "arms[0].offset" = [-1.809, 3.509, 0.004]',
    error="0.2 mm",
    poses="40",
    strokes="[0.0, 1.6]       ",
    turntables="",
    ball_joint="50 deg",
    link_radius="20 mm",
    clearance="50 mm",
    low="[0.9, 2.3, -1.6]",
    high="[1.5, 2.6, -1.2]",
    plate_end="[0.1, 0.0, 0.0]",
    plate_radius="60 mm",
    device='kind = "laser tracker"      # it measures points; a "T-Mac" orientations too, which robots that turn need\n'
    "r = [4.5, 2.9, -0.7]",
    facing="facing = [1.0, 0.0, 0.0]    # where the target looks, in the frame of the tool; left out: seen from everywhere",
    home="# home = [0.79, 0.95, 0.97]",
)
T_MAC = (
    'kind = "T-Mac"              # finds orientations too, as this robot needs it; so do "stereo cameras"\n'
)
SIX = L1 | dict(
    robot='model = "SixLinkGantryTau(D1)"',
    value='"arms[0].links[0].length" = 2.061',
    strokes="[0.0, 2.0]       ",
    low="[2.5, -6.0, -3.0]",
    high="[3.0, -5.0, 1.0]",
    clearance="5 mm",
    ball_joint="45 deg",
    plate_radius="20 mm",
    link_radius="10 mm",
    device=T_MAC + "r = [4.0, -4.0, 0.0]",
    facing="# facing = [1.0, 0.0, 0.0]  # where the target looks, in the frame of the tool; left out: seen from everywhere",
    tape="2 mm",
)
F1 = SIX | dict(
    robot='model = "F1GantryTau(F1)"  ',
    strokes="[-0.6, 0.9]      ",
    ball_joint="45 deg",
    turntables="; turntables as the model has them",
    low="[2.0, -0.5, -1.0]",
    high="[2.5, 0.5, 1.0]",
    device=T_MAC + "r = [-0.2, -2.0, -0.2]",
    home="# home = [0.3, 0.3, 0.3, 0.0, 0.0, 0.0]",
)
KINDS = {"l1": L1, "six": SIX, "f1": F1}
OF_MODELS = {"GantryTau": "l1", "SixLinkGantryTau": "six", "F1GantryTau": "f1"}
OTHERS = "# Limits, device and home below fit {}: make them those of your robot.\n"


def cell_example(kind: str | None = None, robot: str | None = None) -> str:
    """The text of a cell to begin with: of a kind of robot, or of a model of that kind.

    kind: "l1" (three links, the default), "six" (links) or "f1" (turntables); robot: its model as the file names it, such as
    GantryTau(D1). Raises ModelError for another kind, and for a model of none of these without a kind beside it.
    """
    if kind is not None and kind.lower() not in KINDS:
        raise ModelError(
            f"there is no such example{did_you_mean(kind.lower(), KINDS)}",
            place="cell_example",
            found=Given("kind", kind),
        )
    if robot is None:
        return CELL.format(**KINDS[(kind or "l1").lower()])
    name = robot.partition("(")[0]
    if kind is None and name not in OF_MODELS:
        raise ModelError(
            f"expected {', '.join(OF_MODELS)}, or a kind beside it, as ",
            Given("kind", "six"),
            ", for limits, device and home to begin with",
            place="cell_example",
            found=Given("robot", robot),
        )
    known = KINDS[kind.lower() if kind else OF_MODELS[name]]
    named = f'model = "{robot}"'
    # limits, device and home of the example are those of its own robot
    warning = "" if named in known["robot"] else OTHERS.format(known["robot"].split('"')[1])
    return warning + CELL.format(**(known | {"robot": named.ljust(27)}))
