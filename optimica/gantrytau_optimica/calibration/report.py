"""The report of a calibration: one HTML page, complete in itself, and the same numbers as JSON."""

import json
import os
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.calibration.residual_tests import residual_tests

if TYPE_CHECKING:
    from gantrytau_optimica.calibration.calibration import Calibration

BINS = 24
STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1.5rem; }
table { border-collapse: collapse; font-size: .9rem; margin: .5rem 0 1.5rem; }
th, td { text-align: right; padding: .15rem .8rem .15rem 0; border-bottom: 1px solid #8886; }
th:first-child, td:first-child { text-align: left; font-family: ui-monospace, monospace; }
.matrix { overflow-x: auto; } .matrix td { font-size: .7rem; padding-right: .4rem; }
rect { fill: #4a7ebb; } svg text { font: 12px system-ui; fill: currentColor; }
"""


def report_numbers(found: "Calibration") -> dict[str, Any]:
    """Everything that the report says, as plain numbers and lists; lengths in m, angles in rad."""
    errors, vectors = found.errors, found.error_vectors
    good = np.isfinite(errors)
    known = [n for n in found.names if n not in found.undetermined]
    axes = principal_axes(vectors[good])
    counts, edges = np.histogram(errors[good], bins=BINS)
    return {
        "robot": found.geometry.name,
        "model": found.model,
        "method": found.method,
        "loss": found.loss,
        "success": found.success,
        "iterations": found.iterations,
        "poses_fitted": len(found.rows),
        "poses_held_out": len(found.held_out),
        "error_m": _spread(errors[good]),
        "angle_error_rad": _spread(found.angle_errors[np.isfinite(found.angle_errors)]),
        "noise_m": found.noise if np.isfinite(found.noise) else None,
        "parameters": {n: np.asarray(v).tolist() for n, v in found.parameters.items()},
        "deviations": {n: d if np.isfinite(d) else None for n, d in found.deviations.items()},
        "undetermined": list(found.undetermined),
        "covariance": {"names": known, "values": found.covariance().tolist()},
        "principal_axes": axes,
        "residual_tests": residual_tests(found),
        "histogram": {"counts": counts.tolist(), "edges_m": edges.tolist()},
        "findings": [{"kind": f.kind, "rows": f.rows.tolist(), "message": f.message} for f in found.findings],
    }


def principal_axes(vectors: np.ndarray) -> dict[str, Any]:
    """Principal axes of error vectors (N, 3), the longest first: directions, mean sizes along them in m, shares.

    Eigenvalues of E'E / N; the thesis leaves the N out.
    """
    if not len(vectors):
        return {"directions": [], "root_mean_squares_m": [], "shares": []}
    squares, axes = np.linalg.eigh(vectors.T @ vectors / len(vectors))
    squares = np.maximum(squares[::-1], 0.0)
    total = squares.sum()
    return {
        "directions": axes[:, ::-1].T.tolist(),
        "root_mean_squares_m": np.sqrt(squares).tolist(),
        "shares": (squares / total if total > 0 else squares).tolist(),
    }


def _spread(values: np.ndarray) -> dict[str, float | None]:
    """Mean, median and so on; None where nothing was measured."""
    if not values.size:
        return dict.fromkeys(("mean", "median", "p95", "max"))
    return {
        "mean": float(values.mean()),
        "median": float(np.median(values)),
        "p95": float(np.quantile(values, 0.95)),
        "max": float(values.max()),
    }


def write_report(found: "Calibration", path: Path) -> Path:
    """Both files, whole or not at all; the path of the page, which ends in .html."""
    page = (
        path
        if path.suffix in (".html", ".htm")
        else path.with_name(path.name.removesuffix(".json") + ".html")
    )
    numbers = report_numbers(found)
    texts = {
        page: html_report(numbers),
        page.with_suffix(".json"): json.dumps(numbers, indent=1, allow_nan=False),
    }
    fresh = {target: target.with_name(f".{target.name}.{os.getpid()}") for target in texts}
    try:
        for target in texts:
            if target.is_dir():
                raise IsADirectoryError(f"{target} is a directory")
        page.parent.mkdir(parents=True, exist_ok=True)
        for target, text in texts.items():
            fresh[target].write_text(text, encoding="utf-8")
        for target in texts:
            fresh[target].replace(target)
    except OSError as error:
        raise ModelError(
            f"report: found that {page} cannot be written ({error}), expected a file name in a folder that can be written "
            "to; what was there is as before"
        ) from None
    finally:
        for temporary in fresh.values():
            if temporary.exists():
                temporary.unlink()
    return page


def html_report(numbers: dict[str, Any]) -> str:
    """The page of the numbers of a report."""
    title = f"Calibration of {numbers['robot']}"
    parts = [
        f"<h1>{escape(title)}</h1>",
        _summary(numbers),
        "<h2>Findings</h2>",
        _list(f"{f['kind']}: {f['message']}" for f in numbers["findings"]),
        "<h2>Errors of poses that were held out</h2>",
        _errors(numbers),
        histogram(numbers["histogram"]),
        "<h2>Principal axes of the errors</h2>",
        _axes(numbers["principal_axes"]),
        "<h2>Residual tests</h2>",
        _tests(numbers["residual_tests"]),
        "<h2>Parameters</h2>",
        _parameters(numbers),
        "<h2>Correlations</h2>",
        _correlations(numbers["covariance"]),
    ]
    head = f'<meta charset="utf-8"><title>{escape(title)}</title><style>{STYLE}</style>'
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head><body>\n'
        + "\n".join(parts)
        + "\n</body></html>\n"
    )


def _summary(numbers: dict[str, Any]) -> str:
    model = "of the robot" if numbers["model"] is None else numbers["model"]
    verdict = "converged" if numbers["success"] else "did not converge"
    noise = "nothing" if numbers["noise_m"] is None else f"{numbers['noise_m'] * 1e6:.4g} um"
    poses = f"{numbers['poses_fitted']} poses fitted, {numbers['poses_held_out']} held out"
    name = f"Model {escape(str(model))}, loss {escape(numbers['loss'])}"
    return (
        f"<p>{name}, {poses}; {escape(numbers['method'])} {verdict} after "
        f"{numbers['iterations']} steps. What is left is explained by {noise} in each measured coordinate.</p>"
    )


def _list(items: Any) -> str:
    rows = "".join(f"<li>{escape(item)}</li>" for item in items)
    return f"<ul>{rows}</ul>" if rows else "<p>none</p>"


def _table(head: list[str], rows: list[list[str]]) -> str:
    top = "".join(f"<th>{escape(h)}</th>" for h in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in rows)
    return f"<table><tr>{top}</tr>{body}</table>"


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
    return _table(["", "mean", "median", "95 %", "largest"], rows)


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
    return _table(["direction", "root mean square, um", "share"], rows)


def _tests(tests: list[dict[str, Any]]) -> str:
    rows = [[t["link"], t["test"], f"{t['value']:.4g}", f"{t['probability']:.3g}"] for t in tests]
    return _table(["link", "test", "value", "probability by chance"], rows)


def _parameters(numbers: dict[str, Any]) -> str:
    rows = []
    for name, value in numbers["parameters"].items():
        elements = [name] if np.ndim(value) == 0 else [f"{name}[{k}]" for k in range(len(value))]
        for element, x in zip(elements, np.atleast_1d(value), strict=True):
            deviation = numbers["deviations"].get(element, 0.0)
            shown = "not held" if deviation is None else f"{deviation * 1e6:.4g}" if deviation else "-"
            rows.append([element, f"{x:.7f}", shown])
    return _table(["name", "value (m, 1, rad)", "deviation, 1e-6"], rows)


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
    return f'<p>{words}</p><div class="matrix">{_table(["", *map(str, range(len(names)))], rows)}</div>'
