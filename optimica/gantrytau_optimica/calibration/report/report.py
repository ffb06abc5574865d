"""The report of a calibration: one HTML page, complete in itself, and the same numbers as JSON."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import Description, ModelError
from gantrytau.describing.record import Record
from gantrytau.whole_files import replacing
from gantrytau_optimica.calibration.diagnostics.device_frames import Motion
from gantrytau_optimica.calibration.report.described_calibration import calibration_described
from gantrytau_optimica.calibration.report.report_page import html_report
from gantrytau_optimica.calibration.report.residual_tests import residual_tests

BINS = 24
OTHERS = (".pdf", ".csv", ".txt", ".md", ".xlsx", ".xls", ".docx", ".doc", ".odt", ".xml", ".toml")
PICTURES = (".png", ".svg")
LISTED = 2000  # poses, of more the worst


@dataclass(frozen=True, eq=False)
class About(Record):
    """Data of a report beside the calibration itself, all optional.

    robot: its name with its prototype; facts: in words by heading, such as goal and device; good, verdict: whether it is
    good enough; notes: sentences; lines: of the rows in their file (N,); numbers: of the poses in a plan (N,); validation:
    distances of poses from where fits without them expect them, m by row, NaN where there is none.
    """

    robot: str = ""
    facts: Mapping[str, str] = field(default_factory=dict)
    good: bool | None = None
    verdict: str = ""
    notes: Sequence[str] = ()
    lines: np.ndarray | None = None
    numbers: np.ndarray | None = None
    validation: np.ndarray | None = None


def report_numbers(found: Any, about: About | None = None) -> dict[str, Any]:
    """Everything that the report says, as plain numbers and lists; lengths in m, angles in rad."""
    about = about or About()
    errors, vectors = found.errors, found.error_vectors
    good = np.isfinite(errors) & ~np.isin(found.held_out, found.left_out)
    known = [n for n in found.names if n not in found.undetermined]
    counts, edges = np.histogram(errors[good], bins=BINS)
    return {
        "date": datetime.now().astimezone().isoformat(timespec="seconds"),
        "robot": about.robot or found.robot_name,
        "facts": dict(about.facts),
        "verdict": {"good": about.good, "words": about.verdict},
        "model": found.model,
        "method": found.method,
        "loss": found.loss,
        "success": found.success,
        "iterations": found.iterations,
        "poses_fitted": len(found.rows),
        "poses_held_out": len(found.held_out),
        "errors_of": "fitted poses" if fits_all(found) else "held-out poses",
        "error_m": _spread(errors[good]),
        "angle_error_rad": _spread(found.angle_errors[good & np.isfinite(found.angle_errors)]),
        "left_out_rows": found.left_out.tolist(),
        "validation_error_m": _validation(found, about),
        "noise_m": found.noise if np.isfinite(found.noise) else None,
        "transformation": _transformation(found.motion),
        "parameters": {n: np.asarray(v).tolist() for n, v in found.parameters.items()},
        "nominal": nominal_values(found),
        "deviations": {n: d if np.isfinite(d) else None for n, d in found.deviations.items()},
        "undetermined": list(found.undetermined),
        "covariance": {"names": known, "values": found.covariance().tolist()},
        "principal_axes": principal_axes(vectors[good]),
        "residual_tests": residual_tests(found.link_errors()),
        "histogram": {"counts": counts.tolist(), "edges_m": edges.tolist()},
        "findings": [{"kind": f.kind, "rows": f.rows.tolist(), "message": f.message} for f in found.findings],
        "notes": list(about.notes),
        "poses": _poses(found, about),
    }


def fits_all(found: Any) -> bool:
    """Whether errors are those of the fitted poses, as none were held out."""
    return np.array_equal(found.held_out, found.rows)


def _transformation(motion: Motion | None) -> dict[str, Any] | None:
    if motion is None:
        return None
    return {
        "law": "base = rotation @ measured + translation",
        "rotation": motion.rotation.tolist(),
        "translation_m": motion.translation.tolist(),
    }


def _validation(found: Any, about: About) -> dict[str, float | None] | None:
    """Of poses that were left out of fits in turn, or of those held out; None where all errors are those of the fit."""
    if about.validation is not None:
        errors = np.delete(about.validation, found.left_out)
        return _spread(errors[np.isfinite(errors)])
    if fits_all(found):
        return None
    good = np.isfinite(found.errors) & ~np.isin(found.held_out, found.left_out)
    return _spread(found.errors[good])


def nominal_values(found: Any) -> dict[str, float]:
    """The numbers by name that the robot had before, of those that were looked for."""
    values = found.nominal_values
    return scalars({name: values[name] for name in (*found.parameters, *found.names) if name in values})


def scalars(values: Mapping[str, Any]) -> dict[str, float]:
    """Numbers by name; of a vector `v` the elements `v[0]`, `v[1]` and so on."""
    found = {}
    for name, value in values.items():
        elements = [name] if np.ndim(value) == 0 else [f"{name}[{k}]" for k in range(len(value))]
        found |= dict(zip(elements, np.atleast_1d(value).tolist(), strict=True))
    return found


def _poses(found: Any, about: About) -> list[dict[str, Any]]:
    """The error of each pose, in the order of rows; of very many poses the worst."""
    sizes, angles = found.errors, found.angle_errors
    places = np.arange(len(sizes))
    if len(places) > LISTED:
        places = np.sort(np.argsort(-np.where(np.isfinite(sizes), sizes, np.inf))[:LISTED])
    rows = found.held_out
    more = {"line": about.lines, "number": about.numbers, "without_it_m": about.validation}
    listed = []
    for k in places:
        row = int(rows[k])
        one = {"row": row, "q": found.measurements.q[row].tolist()}
        one |= {name: _plain(values[row]) for name, values in more.items() if values is not None}
        one |= {"error_m": _plain(sizes[k]), "vector_m": [_plain(x) for x in found.error_vectors[k]]}
        listed.append(one | {"angle_rad": _plain(angles[k])})
    return listed


def _plain(value: Any) -> float | int | None:
    return None if not np.isfinite(value) else int(value) if isinstance(value, np.integer) else float(value)


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


def write_report(found: Any, path: Path, about: About | None = None) -> Path:
    """Both files, whole or not at all; the path of the page, which ends in .html.

    Raises ModelError for names that end in that of another format, and for what cannot be written.
    """
    if path.suffix.lower() in OTHERS + PICTURES:
        raise ModelError(
            f"report: found the name '{path.name}', expected one that ends in .html, for a page with a .json beside it; "
            "print the page from a browser for other formats"
        )
    page = (
        path
        if path.suffix in (".html", ".htm")
        else path.with_name(path.name.removesuffix(".json") + ".html")
    )
    numbers = report_numbers(found, about)
    page_text, data = html_report(numbers), json.dumps(numbers, indent=1, allow_nan=False)
    try:
        if page.is_dir():
            raise IsADirectoryError(f"{page} is a directory")
        page.parent.mkdir(parents=True, exist_ok=True)
        with replacing(page) as html_file, replacing(page.with_suffix(".json")) as json_file:
            html_file.write_text(page_text, encoding="utf-8")
            json_file.write_text(data, encoding="utf-8")
    except OSError as error:
        raise ModelError(
            f"report: found that {page} cannot be written ({error}), expected a file name in a folder that can be written "
            "to; what was there is as before"
        ) from None
    return page


class Reported:
    """What shows a calibration: `describe`, and a report on file."""

    def __describe__(self, name: str = "") -> Description:
        return calibration_described(self, name)

    def report(self, path: str | Path) -> Path:
        """Write the report as one HTML page to path, and as JSON beside it (.json); returns the path of the page.

        A path that ends in .json names both files too; another ending, such as .pdf, raises ModelError.
        Errors, residual tests, parameters with deviations, covariance, principal axes of the errors, histogram.
        """
        return write_report(self, Path(path))
