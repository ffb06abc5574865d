"""Logs of motion on file: CSV, as programs of controllers, spreadsheets and `Result.save` write it."""

import csv
import io
import re
from pathlib import Path

import numpy as np

from gantrytau import ModelError
from gantrytau.border.columns import SEPARATORS, check_cells, is_number, number_of
from gantrytau.whole_files import replacing
from gantrytau_optimica.identification.logs.log_columns import EXPECTED, LogColumn, columns_of

Arrays = dict[str, np.ndarray | None]
HEAD = 20  # lines, among which names and the first numbers stand


def read_log(path: Path) -> Arrays:
    """Arrays t, q, f, v, r of a log in SI, as `MotionLog` takes them.

    Raises ModelError for what is no such file, with the line of a cell that is no number.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ModelError(
            f"{path}: found no file to read ({error.strerror}), expected a CSV file of a log"
        ) from None
    except UnicodeDecodeError as error:
        raise ModelError(
            f"{path}: cannot be read as text ({error}); save it as CSV with the encoding UTF-8"
        ) from None
    separator, header, before, start = _head(path, text)
    columns = columns_of(path, header)
    chosen = [columns.t, *columns.q, *columns.f, *(columns.v or ()), *(columns.r or ())]
    table = _numbers(path, text[start:], before, header, chosen, separator)
    table *= [column.factor for column in chosen]
    n = len(columns.q)
    q, f, v, r = np.split(table[:, 1:], np.cumsum([n, n, n if columns.v else 0]), axis=1)
    return dict(t=table[:, 0], q=q, f=f, v=v if columns.v else None, r=r if columns.r else None)


def lines_of(path: Path, rows: np.ndarray) -> np.ndarray:
    """Lines of a file, from 1, in which rows of its log, from 0, stand: headers, empty lines and comments are no rows."""
    text = path.read_text(encoding="utf-8-sig")
    _, _, before, start = _head(path, text)
    kept = [
        number
        for number, line in enumerate(io.StringIO(text[start:]), before + 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    return np.array(kept, dtype=int)[rows]


def write_log(path: Path, arrays: Arrays) -> None:
    """Write a log, in SI, so that it is read to the last digit."""
    names, kept = [], []
    for name, array in arrays.items():
        if array is None:
            continue
        columns = array.reshape(len(array), -1)
        if name in "tr":
            names += ["t [s]"] if name == "t" else ["x [m]", "y [m]", "z [m]"]
        else:
            names += [f"{name}{k + 1}" for k in range(columns.shape[1])]
        kept.append(columns)
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(np.column_stack(kept).tolist())


def _head(path: Path, text: str) -> tuple[str, list[str], int, int]:
    """Separator, names, lines before the first numbers, and where these start; names stand in the last line before."""
    start, names = 0, ""
    for _ in range(HEAD):
        end = text.find("\n", start) + 1 or len(text)
        line = text[start:end].strip()
        if line and is_number(re.split(r"[;\t,\s]", line)[0].strip('"'), ","):
            break
        names, start = line.lstrip("#").strip() or names, end
        if start == len(text):
            raise ModelError(
                f"{path}: found no rows of numbers, expected a header and one line for each time"
            )
    else:
        raise ModelError(f"{path}: found no numbers in the first {HEAD} lines; {EXPECTED}")
    if not names:
        raise ModelError(f"{path}: found numbers in the first line, expected names there; {EXPECTED}")
    separator = next((one for one in SEPARATORS if one in names), " ")
    header = next(csv.reader([names], delimiter=separator)) if separator != " " else names.split()
    return separator, header, text.count("\n", 0, start), start


def _numbers(
    path: Path, text: str, before: int, header: list[str], chosen: list[LogColumn], separator: str
) -> np.ndarray:
    """The columns that are read, (N, k), empty cells NaN."""
    read = text.replace(",", ".") if separator != "," else text
    del text
    places = [column.place for column in chosen]
    for attempt in (read, None):
        try:
            text = attempt if attempt is not None else _filled(read, separator)
            found = np.loadtxt(
                io.StringIO(text),
                delimiter=None if separator == " " else separator,
                usecols=places,
                quotechar='"',
                ndmin=2,
            )
        except ValueError:
            continue
        if separator != "," or _as_wide(read, len(header)):
            return found
    _refuse(path, read, before, header, places, separator)
    raise ModelError(f"{path}: cannot be read as rows of {len(header)} numbers; {EXPECTED}")


def _filled(text: str, separator: str) -> str:
    """Text whose empty cells are NaN."""
    return re.sub(rf"(?m)(?<={separator})[ ]*(?=[{separator}\r\n]|\Z)|^[ ]*(?={separator})", "nan", text)


def _as_wide(text: str, count: int) -> bool:
    """Whether the first lines have as many cells as the header: commas before decimals make more of them."""
    rows = csv.reader(io.StringIO(text[:100_000].rpartition("\n")[0] or text))
    return all(len(row) in (0, count) or row[0].startswith("#") for row in rows)


def _refuse(path: Path, text: str, before: int, header: list[str], places: list[int], separator: str) -> None:
    """ModelError for the first cell that is no number, and the first line that has too few or too many cells."""
    lines = io.StringIO(text)
    rows = (line.split() for line in lines) if separator == " " else csv.reader(lines, delimiter=separator)
    for line, row in enumerate(rows, before + 1):
        if not row or row[0].startswith("#"):
            continue
        check_cells(path, line, row, len(header), separator)
        for place in places:
            number_of(path, line, header[place].strip(), row[place], separator)
