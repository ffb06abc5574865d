"""What a robot learnt: run after run, on file, and to go on from."""

import json
import os
import zipfile
import zlib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from gantrytau import ModelError
from gantrytau.describing.record import Record
from gantrytau.whole_files import replacing
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.learning.laws.learning import Stability
from gantrytau_optimica.learning.runs.corrections_file import write_corrections
from gantrytau_optimica.learning.runs.foretold import not_as_foretold
from gantrytau_optimica.learning.runs.history_tables import error_table, history_dataset
from gantrytau_optimica.learning.runs.reference import Reference

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

FORMAT = "gantrytau learning 1"
ROWS = ("inputs", "q_ref", "q", "tool", "estimates")  # what is kept of each run


@dataclass(frozen=True, eq=False, repr=False)
class History(Record):
    """Runs of a learning robot: K + 1 of them, N samples, n joints, m corrections.

    reference: of the tool; names: what is corrected, joints or axes of the tool; columns: these of the tool, none for
    joints; full: the samples (N,) by which errors are judged, (7.25); inputs: corrections (K + 1, N, m); q_ref, q:
    references and measured positions of the joints (K + 1, N, n); tool: measured (K + 1, N, 3), of the kinematics where
    nothing else measures it; estimates, wanted: of what is learnt from, (K + 1, N, m) and (N, m); next_input: corrections
    (N, m) of the run that would follow; settings: words of what learnt, "since" the run from which this law learnt;
    stability: foretold, None of a history that was read.
    """

    reference: Reference
    joints: tuple[str, ...]
    names: tuple[str, ...]
    columns: tuple[int, ...]
    wanted: np.ndarray
    full: np.ndarray
    settings: dict[str, Any]
    inputs: np.ndarray
    q_ref: np.ndarray
    q: np.ndarray
    tool: np.ndarray
    estimates: np.ndarray
    next_input: np.ndarray
    stability: Stability | None = field(default=None)

    def __len__(self) -> int:
        return len(self.inputs)

    def __repr__(self) -> str:
        return f"<History: {len(self)} runs of {', '.join(self.names)}>"

    def __str__(self) -> str:
        tool = list(self.reference.moving)
        heads = [*self.names, *(f"tool {'xyz'[k]}" for k in tool)]
        width = max(8, *(len(head) + 2 for head in heads))
        lines = [repr(self)[1:-1]]
        if self.stability is not None:
            lines.append(str(self.stability))
        lines += map(str, self.findings)
        lines.append("errors in % of the first run")
        lines.append("run " + "".join(f"{head:>{width}}" for head in heads))
        table = np.hstack([self.relative, self.tool_relative[:, tool]])
        lines += [f"{k:3d} " + "".join(f"{value:{width}.2f}" for value in row) for k, row in enumerate(table)]
        return "\n".join(lines)

    @property
    def input(self) -> np.ndarray:
        """Corrections (N, m) of the last run."""
        return self.inputs[-1]

    @property
    def corrected(self) -> np.ndarray:
        """Corrections of the joints (N, n) of the last run, however they were learnt: what a controller adds."""
        return self.q_ref[-1] - self.q_ref[0]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What came otherwise than foretold: "foretold", with the runs whose corrections did not follow the response."""
        if self.stability is None:
            return ()
        u, first = np.concatenate([self.inputs, self.next_input[None]]), self.settings.get("since", 0)
        return not_as_foretold(u[first:], self.stability, first)

    def error(self, k: int = -1) -> np.ndarray:
        """What is wanted less what was estimated in run k, (N, m): (7.23) or (7.24)."""
        return self.wanted - self.estimates[k]

    def tool_error(self, k: int = -1) -> np.ndarray:
        """Reference of the tool less its measured position in run k, (N, 3): (7.24)."""
        return self.reference.r - self.tool[k]

    @property
    def relative(self) -> np.ndarray:
        """Errors of what is learnt from in % of those of run 0, (K + 1, m), where corrections apply in full: (7.25)."""
        return self._relative(self.error)

    @property
    def tool_relative(self) -> np.ndarray:
        """The same of the measured tool, (K + 1, 3); NaN of axes in which it does not move."""
        found = self._relative(self.tool_error)
        found[:, [k for k in range(3) if k not in self.reference.moving]] = np.nan
        return found

    def _relative(self, error: Any) -> np.ndarray:
        sizes = np.array([np.linalg.norm(error(k)[self.full], axis=0) for k in range(len(self))])
        with np.errstate(invalid="ignore", divide="ignore"):
            return 100 * sizes / sizes[0]

    def plot(self, what: str = "errors", *, file: str | os.PathLike[str] | None = None) -> "Figure":
        """Draw "errors" over runs, "error", "input" or "tool" over time, or the "path" of the tool, and return the figure.

        Dressler (2012), Figures 7.5 to 7.18. Raises ModelError for another picture.
        """
        from gantrytau_optimica.learning.runs.history_pictures import draw

        return draw(self, what, file)

    def to_xarray(self) -> "xarray.Dataset":
        """All runs as a dataset: "input", "estimate" and "wanted" over run, time and correction, "q_ref" and "q" over run,
        time and joint, "tool" and "reference" over axis; GantryTauError without xarray (extra `results`).
        """
        return history_dataset(self)

    def to_pandas(self) -> "pandas.DataFrame":
        """Errors in % of those of run 0, a row for each run, a column for each name and axis of the tool that moves."""
        return error_table(self)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write all runs to a file (.npz), from which `learn(..., history=)` goes on; it appears whole."""
        path = _npz(path)
        about = {name: getattr(self, name) for name in ("joints", "names", "columns", "settings")}
        about["format"] = FORMAT
        arrays = {name: getattr(self, name) for name in (*ROWS, "wanted", "full", "next_input")}
        with replacing(path) as partial, partial.open("wb") as file:
            np.savez_compressed(
                file, about=np.array(json.dumps(about)), t=self.reference.t, r=self.reference.r, **arrays
            )
        return path

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote. Raises ModelError for other files."""
        path = _npz(path)
        try:
            with np.load(path, allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            about = json.loads(str(arrays.pop("about")))
            if about.pop("format") != FORMAT:
                raise KeyError("format")
            reference = Reference(arrays.pop("t"), arrays.pop("r"))
            for name in ("joints", "names", "columns"):
                about[name] = tuple(about[name])
            return cls(reference=reference, **about, **arrays)
        except FileNotFoundError:
            raise ModelError(f"{path}: found no such file, expected a history of learning") from None
        except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, zlib.error) as error:
            raise ModelError(
                f"{path}: found a file that is no history of learning ({error}), expected one that History.save wrote; "
                "if it was cut off or damaged, remove it to begin anew"
            ) from None

    def save_corrections(self, path: str | os.PathLike[str]) -> Path:
        """Write corrections of the joints of the last run, a column for each, for a controller to add; CSV and others.

        Formats are those of `Result.save`; times are those of the reference.
        """
        return write_corrections(path, self.reference.t, self.joints, self.corrected)

    def with_run(self, **rows: np.ndarray) -> "History":
        """With one run more, by the names of what is kept."""
        return replace(
            self, **{name: np.concatenate([getattr(self, name), rows[name][None]]) for name in ROWS}
        )


def _npz(path: str | os.PathLike[str]) -> Path:
    path = Path(path)
    if path.suffix.lower() != ".npz":
        raise ModelError(
            f"{path}: found the suffix '{path.suffix}', expected .npz for a history", argument="file"
        )
    return path
