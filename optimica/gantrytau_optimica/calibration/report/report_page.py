"""The page of a report of a calibration: the verdict first, then errors, parameters, poses."""

from html import escape
from typing import Any

import numpy as np

from gantrytau.describing.pages import folded, page, table, verdict

STYLE = """
.matrix { overflow-x: auto; } .matrix td { font-size: .7rem; padding-right: .4rem; }
rect { fill: #4a7ebb; } svg text { font: 12px system-ui; fill: currentColor; }
"""


def html_report(numbers: dict[str, Any]) -> str:
    """The page of the numbers of a report."""
    title = f"Calibration of {numbers['robot']}"
    of_fit = numbers["errors_of"] == "fitted poses"
    parts = [
        f"<h1>{escape(title)}</h1>",
        _verdict(numbers["verdict"]),
        _facts(numbers),
        _summary(numbers),
        "<h2>Findings</h2>",
        _list([*(f"{f['kind']}: {f['message']}" for f in numbers["findings"]), *numbers["notes"]]),
        "<h2>Errors of the fitted poses</h2>" if of_fit else "<h2>Errors of poses that were held out</h2>",
        _errors(numbers),
        histogram(numbers["histogram"]),
        *_transformation(numbers["transformation"]),
        "<h2>Principal axes of the errors</h2>",
        _axes(numbers["principal_axes"]),
        "<h2>Residual tests</h2>",
        _tests(numbers["residual_tests"]),
        "<h2>Parameters</h2>",
        _parameters(numbers),
        "<h2>Correlations</h2>",
        _correlations(numbers["covariance"]),
        "<h2>Poses</h2>",
        _poses(numbers),
    ]
    return page(title, parts, STYLE)


def _verdict(said: dict[str, Any]) -> str:
    if said["good"] is None:
        return ""
    return verdict(said["good"], "Good" if said["good"] else "Not good enough", [said["words"]])


def _facts(numbers: dict[str, Any]) -> str:
    rows = {"date": numbers["date"].replace("T", " "), "robot": numbers["robot"], **numbers["facts"]}
    return table((), rows.items())


def _summary(numbers: dict[str, Any]) -> str:
    model = "of the robot" if numbers["model"] is None else numbers["model"]
    verdict = "converged" if numbers["success"] else "did not converge"
    noise = "nothing" if numbers["noise_m"] is None else f"{numbers['noise_m'] * 1e6:.4g} um"
    poses = f"{numbers['poses_fitted']} poses fitted"
    poses += (
        ", which are all"
        if numbers["errors_of"] == "fitted poses"
        else f", {numbers['poses_held_out']} held out"
    )
    name = f"Model {escape(str(model))}, loss {escape(numbers['loss'])}"
    return (
        f"<p>{name}, {poses}; {escape(numbers['method'])} {verdict} after "
        f"{numbers['iterations']} steps. What is left is explained by {noise} in each measured coordinate.</p>"
    )


def _transformation(motion: dict[str, Any] | None) -> list[str]:
    if motion is None:
        return []
    rows = [
        [*(f"{x:+.9f}" for x in row), f"{t:+.6f}"]
        for row, t in zip(motion["rotation"], motion["translation_m"], strict=True)
    ]
    words = "From the frame of the measurements to the base of the robot: base = R measured + t."
    return [
        "<h2>Frame of the measurements</h2>",
        f"<p>{words}</p>",
        table(["R", "", "", "t, m"], rows, "numbers"),
    ]


def _poses(numbers: dict[str, Any]) -> str:
    """A table that is folded."""
    listed = numbers["poses"]
    if not listed:
        return "<p>none</p>"
    first = listed[0]
    names = [name for name in ("line", "number") if name in first] or ["row"]
    heads = [*names, *(f"q{k + 1}" for k in range(len(first["q"])))]
    scales = {"error_m": ("error, um", 1e6)}
    if "without_it_m" in first:
        scales["without_it_m"] = ("by a fit without it, um", 1e6)
    if any(one["angle_rad"] is not None for one in listed):
        scales["angle_rad"] = ("turned by, mdeg", 180e3 / np.pi)
    rows = []
    for one in listed:
        cells = [str(one[name]) for name in names] + [f"{x:.6g}" for x in one["q"]]
        cells += [
            f"{one[key] * scale:.4g}" if one[key] is not None else "-" for key, (_, scale) in scales.items()
        ]
        vector = [f"{x * 1e6:+.1f}" if x is not None else "-" for x in one["vector_m"]]
        rows.append([*cells, *vector])
    head = [*heads, *(name for name, _ in scales.values()), "x, um", "y, um", "z, um"]
    which = "the worst poses" if len(listed) < numbers["poses_held_out"] else "all poses"
    return folded(f"Errors of {len(listed)} poses ({which})", [table(head, rows, "numbers")])


def _list(items: Any) -> str:
    rows = "".join(f"<li>{escape(item)}</li>" for item in items)
    return f"<ul>{rows}</ul>" if rows else "<p>none</p>"


def _errors(numbers: dict[str, Any]) -> str:
    rows = []
    for name, key, scale, unit in (
        ("position", "error_m", 1e6, "um"),
        ("orientation", "angle_error_rad", 180e3 / np.pi, "mdeg"),
    ):
        spread = numbers[key]
        if spread["mean"] is not None:
            cells = [f"{spread[k] * scale:.4g}" for k in ("mean", "median", "p95", "max")]
            rows.append([f"{name}, {unit}", *cells])
    validation = numbers["validation_error_m"]
    if numbers["errors_of"] == "fitted poses" and validation and validation["mean"] is not None:
        cells = [f"{validation[k] * 1e6:.4g}" for k in ("mean", "median", "p95", "max")]
        rows.append(["position, by fits without the pose, um", *cells])
    return table(["", "mean", "median", "95 %", "largest"], rows, "numbers")


def histogram(bars: dict[str, Any], width: int = 640, height: int = 180) -> str:
    """A histogram of errors as SVG."""
    counts, edges = bars["counts"], np.array(bars["edges_m"]) * 1e6
    if not any(counts):
        return "<p>There is no error to show.</p>"
    tallest, step = max([*counts, 1]), width / max(1, len(counts))
    shapes = "".join(
        f'<rect x="{k * step:.1f}" y="{height - height * c / tallest:.1f}" width="{step - 1:.1f}" '
        f'height="{height * c / tallest:.1f}"><title>{edges[k]:.4g} to {edges[k + 1]:.4g} um: {c}</title></rect>'
        for k, c in enumerate(counts)
    )
    words = f'<text x="0" y="{height + 16}">{edges[0]:.4g} um</text>'
    words += f'<text x="{width}" y="{height + 16}" text-anchor="end">{edges[-1]:.4g} um</text>'
    return f'<svg viewBox="0 0 {width} {height + 24}" width="{width}" role="img">{shapes}{words}</svg>'


def _axes(axes: dict[str, Any]) -> str:
    rows = [
        [", ".join(f"{x:+.3f}" for x in direction), f"{size * 1e6:.4g}", f"{100 * share:.1f} %"]
        for direction, size, share in zip(
            axes["directions"], axes["root_mean_squares_m"], axes["shares"], strict=True
        )
    ]
    return table(["direction", "root mean square, um", "share"], rows, "numbers")


def _tests(tests: list[dict[str, Any]]) -> str:
    rows = [[t["link"], t["test"], f"{t['value']:.4g}", f"{t['probability']:.3g}"] for t in tests]
    return table(["link", "test", "value", "probability by chance"], rows, "numbers")


def _parameters(numbers: dict[str, Any]) -> str:
    rows = []
    for name, value in numbers["parameters"].items():
        elements = [name] if np.ndim(value) == 0 else [f"{name}[{k}]" for k in range(len(value))]
        for element, x in zip(elements, np.atleast_1d(value), strict=True):
            deviation = numbers["deviations"].get(element, 0.0)
            shown = "not held" if deviation is None else f"{deviation * 1e6:.4g}" if deviation else "-"
            before = numbers["nominal"].get(element)
            old = ["-", "-"] if before is None else [f"{before:.7f}", f"{x - before:+.7f}"]
            rows.append([element, f"{x:.7f}", shown, *old])
    return table(["name", "value (m, 1, rad)", "deviation, 1e-6", "nominal", "change"], rows, "numbers")


def _correlations(covariance: dict[str, Any]) -> str:
    names, C = covariance["names"], np.array(covariance["values"])
    if not names:
        return "<p>none</p>"
    d = np.sqrt(np.maximum(np.diag(C), 1e-300))
    rows = [
        [f"{k} {name}", *(f"{100 * x:.0f}" for x in row)]
        for k, (name, row) in enumerate(zip(names, C / np.outer(d, d), strict=True))
    ]
    words = "In per cent; the covariance itself, in m2, stands in the JSON file beside this page."
    return f'<p>{words}</p><div class="matrix">{table(["", *map(str, range(len(names)))], rows, "numbers")}</div>'
