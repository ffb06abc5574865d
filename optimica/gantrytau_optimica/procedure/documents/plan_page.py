"""The page of a plan: what a technician needs, the verdict first."""

from base64 import b64encode
from html import escape
from pathlib import Path

import numpy as np

from gantrytau.describing.pages import page, table, verdict
from gantrytau_optimica.fitting.finding import length_text
from gantrytau_optimica.procedure.documents.rapid import OPERATOR
from gantrytau_optimica.procedure.pose_choice import CRITERION
from gantrytau_optimica.procedure.pose_plan import PosePlan

STYLE = ".passed { opacity: .6; } img { max-width: 100%; background: white; }"


def html_page(
    plan: PosePlan,
    picture: Path | None,
    program: str,
    *,
    folder: str | Path = ".",
    trigger: str = OPERATOR,
) -> str:
    """The page, complete in itself; picture: a PNG file that goes into it; folder: where it is to stand."""
    title = f"Calibration plan of {plan.robot_name}"
    parts = [
        f"<h1>{escape(title)}</h1>",
        _verdict(plan),
        "<h2>What to do</h2>",
        _steps(plan, program, folder, trigger),
        "<h2>The cell</h2>",
        _image(picture),
        "<h2>In numbers</h2>",
        _facts(plan),
        "<h2>Simulated calibrations</h2>",
        _trials(plan),
        "<h2>Poses</h2>",
        _poses(plan),
    ]
    return page(title, parts, STYLE)


def _verdict(plan: PosePlan) -> str:
    word = "Good: go ahead" if plan.verdict.good else "Not good enough yet"
    return verdict(plan.verdict.good, word, plan.verdict.reasons)


def _steps(plan: PosePlan, program: str, folder: str | Path, trigger: str) -> str:
    count = int(plan.measured.sum())
    turned = ",qw,qx,qy,qz" if plan.kind != "three links" else ""
    place = ", ".join(f"{x:.3g}" for x in np.asarray(plan.settings["device_r"], dtype=float))
    home = ", ".join(_joint(plan, k, x) for k, x in enumerate(plan.q[0]))
    waits = (
        "It stops at {} poses, says which, and waits until Done is pressed on the pendant."
        if trigger == OPERATOR
        else "It stops at {} poses, says which, and goes on by itself after a time."
    ).format(count)
    steps = [
        f"Put the {plan.settings['device']} at ({place}) m in the axes of the robot base. A few centimetres do not "
        "matter, the "
        "measurements may stay in its own axes.",
        f"Jog the robot to home by hand: {home}. The way there is yours; all others were checked.",
        f"Load {program} and run it slowly, with a hand on the stop. {waits} Do not change the order or the kind of move: "
        f"only these ways were checked. Safe means: {plan.safety}.",
        f"Save measurements-template.csv as measurements.csv and fill in x, y, z{turned} as measured, in m"
        f"{_target(plan)}; q stands there as commanded (m and rad). Leave empty what was not seen. A file of your own needs "
        f"the header {plan.header}.",
        "Run: " + plan.command(folder),
    ]
    return "<ol>" + "".join(f"<li>{escape(step)}</li>" for step in steps) + "</ol>"


def _target(plan: PosePlan) -> str:
    """Which point x, y, z is: devices that find orientations know where the tool is, a tracker only its target."""
    if plan.settings["device"] == "LaserTracker":
        return ", of the target (the reflector), which is the tool of the robot that is found"
    return ", of the tool frame, which the device finds from its target"


def _joint(plan: PosePlan, k: int, value: float) -> str:
    name = plan.joints[k]
    return f"{name} = {value * 1e3:.1f} mm" if k < plan.carts else f"{name} = {np.degrees(value):.2f} deg"


def _image(picture: Path | None) -> str:
    if picture is None:
        return "<p>No picture: the plan was loaded without its robot.</p>"
    data = b64encode(picture.read_bytes()).decode()
    return f'<img alt="workspace, obstacles, poses and ways from three sides" src="data:image/png;base64,{data}">'


def _facts(plan: PosePlan) -> str:
    asked, found = plan.settings, plan.prediction
    rows = [
        ["robot", f"{plan.robot_name}, {plan.kind}"],
        ["wanted error of the tool", length_text(asked["wanted"])],
        ["tape measure", f"{length_text(asked['tape'])} standard deviation of joints and lengths"],
        ["workspace", str(plan.workspace)],
        ["noise of the device", f"{length_text(found.noise)} per axis" + _angle(found.noise_angle)],
        [
            "expected error by noise",
            f"{length_text(found.error)} in the mean, {length_text(float(found.position.max()))} at the worst place",
        ],
        ["condition number", f"{found.condition:.4g}"],
        ["observability index", f"{found.observability:.4g}"],
        ["criterion", CRITERION],
        ["worst simulated robot", f"{length_text(plan.verdict.error)} after calibration"],
        ["checked", f"the nominal robot, and {plan.safety}"],
        ["not reached and replaced", _lost(plan)],
    ]
    return table((), rows)


def _lost(plan: PosePlan) -> str:
    return "; ".join("(" + ", ".join(f"{x:.3f}" for x in r) + ") m" for r in plan.lost) or "none"


def _angle(angle: float) -> str:
    return f", {np.degrees(angle) * 1e3:.3g} mdeg" if angle else ""


def _trials(plan: PosePlan) -> str:
    trials = plan.trials
    head = ("robot", "before", "after, mean", "after, largest", "not seen", "")
    rows = [
        (str(k + 1), length_text(before), length_text(after), length_text(largest), f"{unseen:.0f}", note)
        for k, (before, after, largest, unseen, note) in enumerate(
            zip(trials.before, trials.after, trials.largest, trials.unseen, trials.notes, strict=True)
        )
    ]
    return (
        "<p>Errors of the tool over the workspace, robots laid over each other best. With 25 readings of each pose averaged "
        f"the worst robot has {length_text(trials.averaged)}.</p>{table(head, rows, 'numbers')}"
    )


def _poses(plan: PosePlan) -> str:
    names = [f"{name} [{'mm' if k < plan.carts else 'deg'}]" for k, name in enumerate(plan.joints)]
    heads = ["number", *names, "x [m]", "y [m]", "z [m]", ""]
    rows = []
    rows_of_plan = zip(plan.numbers, plan.q, plan.r, plan.measured, strict=True)
    for k, (number, q, r, measured) in enumerate(rows_of_plan):
        joints = [f"{x * 1e3:.4f}" if i < plan.carts else f"{np.degrees(x):.5f}" for i, x in enumerate(q)]
        word = "measure" if measured else "home" if k in (0, len(plan.q) - 1) else "pass"
        rows.append([str(number), *joints, *(f"{x:.3f}" for x in r), word])
    return table(heads, rows, "numbers", ["" if measured else 'class="passed"' for measured in plan.measured])
