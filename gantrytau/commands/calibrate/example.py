"""What `gantrytau calibrate --example` prints: the file of a cell, to be filled in."""

EXAMPLE = """\
# A robot cell to be calibrated. Make this file your own, then: gantrytau calibrate cell.toml
# Numbers are in SI, m and rad; a text may bring another unit, as "5 mm" or "40 deg". Positions are in the world.

[robot]
model = "GantryTau(L1)"     # as the other commands name it; a class of your own: "robot.py:Robot"
tape = "5 mm"               # standard deviation of the tape measure, from which values below are known

[values]                    # what the tape measure says, by the names of the model; all else is the model's own
# "arms[0].length" = 2.061
# "arms[0].offset" = [-1.809, 3.509, 0.004]

[goal]
error = "0.2 mm"            # of the tool, in the mean over the workspace, to be reached after calibration
poses = 40                  # to be measured

[limits]
strokes = [0.0, 1.6]        # of all carts, or [[0.0, 1.6], [0.0, 1.6], [0.0, 1.4]], as the controller shows them
ball_joint = "50 deg"       # largest angle of a link from the axis of its joint
link_radius = "20 mm"
stroke_margin = "20 mm"     # what must be left of each limit, for safety
angle_margin = "3 deg"
clearance = "50 mm"         # between links or plate and anything else

[[limits.obstacles]]        # as many as there are, or none
kind = "box"                # or "cylinder" and "capsule" with start, end, radius
low = [0.9, 2.3, -1.6]
high = [1.5, 2.6, -1.2]

[[limits.plate]]            # capsules that stand for plate and tool, in the frame of the tool
start = [0.0, 0.0, 0.0]
end = [0.1, 0.0, 0.0]
radius = "60 mm"

[device]
kind = "laser tracker"      # or "T-Mac", "single camera", "stereo cameras"; a camera says `at`, where it looks
r = [4.5, 2.9, -0.7]        # where it stands, roughly; measurements may be in its own frame
target = [0.05, 0.0, 0.0]   # the reflector, in the frame of the tool
facing = [1.0, 0.0, 0.0]    # where the reflector looks, in the frame of the tool; left out: seen from everywhere

[plan]
robots = 10                 # simulated ones, with errors as the tape measure leaves them; all must be safe in all poses
# home = [0.5, 0.5, 0.5]    # actuators at begin and end; left out: a place in the middle

[program]                   # of the robot, in RAPID
name = "Calibration"
speed = "100 mm/s"
settle = 1.0                # s, until the tool stands still
carts = "robax"             # or "extax"
"""
