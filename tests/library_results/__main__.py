"""`make library-results`: the examples that the reference results name, and a table of what became of them.

By environment: MODELICAPATH, the folder of the libraries; REFERENCE_RESULTS, the folder of the reference results; ONLY, an
example or a package; TIME_LIMIT, s of processor time for an example; AGAIN=1 to run what has an outcome, too. Examples of
another library than Modelica, in the first folder of MODELICAPATH, are run without a reference. Outcomes are kept in
build/library_results: a run that was interrupted goes on where it was.
"""

import hashlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path

from gantrytau import ModelError
from gantrytau.modelica import read_tree
from gantrytau.modelica.elaboration.library import version_of
from tests.library_results.example import NOT_RUN, Outcome, one_line
from tests.library_results.references import SIGNALS, Example, Reference, examples, references
from tests.library_results.summary import print_summary, write_summary

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "build" / "library_results"
CODE = ("gantrytau", "tests/library_results")
PROCESSES = 2
TIME_LIMIT = 60.0  # s of processor time
WALL = 4  # times the limit, on a machine that others use as well
VERSION = "4.1.0"  # of the library that the reference results are of


def folder_of(variable: str, holds: str, found: Iterable[Path]) -> Path:
    """The folder that a variable of the environment names, the first of its list; SystemExit says what is missing."""
    given = os.environ.get(variable, "").split(os.pathsep)[0]
    if not given or not Path(given).is_dir():
        what = f"found {variable}={given}, no folder" if given else f"{variable} is not set"
        raise SystemExit(f"library-results: {what}, expected the folder that holds {holds}")
    if next(iter(found), None) is None:
        raise SystemExit(f"library-results: {variable}={given}: found no {holds}, expected them in it")
    return Path(given)


def digest(files: Iterable[Path]) -> str:
    """A short digest of the names and contents of files."""
    found = hashlib.sha256()
    for path in sorted(files):
        found.update(path.name.encode())
        found.update(path.read_bytes())
    return found.hexdigest()[:16]


def run(reference: Reference, library: Path, key: str, limit: float) -> Outcome:
    """The outcome of an example in a process of its own, kept in a file."""
    command = [sys.executable, "-m", "tests.library_results.example"]
    root = "" if isinstance(reference, Example) else str(reference.root)
    command += [reference.name, str(library), root, str(limit)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=WALL * limit, cwd=ROOT)
        if done.returncode == 0:
            outcome = Outcome(**json.loads(done.stdout.splitlines()[-1]))
        elif done.returncode == -signal.SIGXCPU:
            outcome = Outcome(reference.name, NOT_RUN, f"longer than {limit:g} s of processor time")
        else:
            last = (done.stderr.strip().splitlines() or [""])[-1]
            outcome = Outcome(reference.name, NOT_RUN, f"the process ended with {done.returncode}: {last}")
    except subprocess.TimeoutExpired:
        outcome = Outcome(reference.name, NOT_RUN, f"longer than {WALL * limit:g} s")
    outcome = replace(outcome, key=key)
    (KEPT / f"{reference.name}.json").write_text(json.dumps(asdict(outcome)), encoding="utf-8")
    return outcome


def kept(reference: Reference, key: str) -> Outcome | None:
    """The outcome of an earlier run of the same sources, code and limit."""
    path = KEPT / f"{reference.name}.json"
    try:
        found = Outcome(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):  # none, or one that was interrupted while written
        return None
    return found if found.key == key else None


def main() -> int:
    """Runs what is asked for and has no outcome yet; prints the table and writes that of the site."""
    library = folder_of("MODELICAPATH", "package.mo", _packages("MODELICAPATH"))
    only = os.environ.get("ONLY", "")
    limit = float(os.environ.get("TIME_LIMIT") or TIME_LIMIT)
    every = _asked(library, only)
    asked = [one for one in every if not only or f"{one.name}.".startswith(f"{only.rstrip('.')}.")]
    if not asked:
        raise SystemExit(
            f"library-results: found no example ONLY={only}, expected one or a package of {library}"
        )
    versions = {}
    for name in dict.fromkeys(one.name.partition(".")[0] for one in asked):
        try:
            versions[name] = version_of(read_tree(library / name / "package.mo").classes[0])
        except ModelError as error:
            raise SystemExit(f"library-results: {name}: {one_line(error)}") from error
        if versions[name] != VERSION and not isinstance(asked[0], Example):
            print(
                f"{name}: found version {versions[name]!r}, expected {VERSION}, that of the reference results"
            )
    sources = digest(path for path in library.rglob("*.mo"))
    code = digest(path for folder in CODE for path in (ROOT / folder).rglob("*.py"))
    KEPT.mkdir(parents=True, exist_ok=True)

    def outcome(one: Reference) -> Outcome:
        key = f"{sources} {code} {digest(path for path in one.folder.glob('*') if path.is_file())} {limit:g}"
        found = None if os.environ.get("AGAIN") else kept(one, key)
        found = found or run(one, library, key, limit)
        print(f"{found.name}: {found.word} {found.detail}".rstrip(), flush=True)
        return found

    with ThreadPoolExecutor(PROCESSES) as pool:
        found = dict(zip(asked, pool.map(outcome, asked), strict=True))
    print_summary(found)
    whole = {one.package for one in asked}
    if only:  # packages of which only a part was run stay as they are on the site
        whole -= {one.package for one in every if one not in found}
    write_summary({one: what for one, what in found.items() if one.package in whole}, versions, sources)
    return 0


def _asked(library: Path, only: str) -> list[Reference]:
    """All examples with reference results; without these, those of the package that ONLY names."""
    if (
        not os.environ.get("REFERENCE_RESULTS")
        and only
        and not f"{only}.".startswith(("Modelica.", "ModelicaTest."))
    ):
        return examples(library, only.partition(".")[0])
    return references(folder_of("REFERENCE_RESULTS", SIGNALS, _signals("REFERENCE_RESULTS")))


def _packages(variable: str) -> Iterable[Path]:
    return Path(os.environ.get(variable, "").split(os.pathsep)[0]).glob("*/package.mo")


def _signals(variable: str) -> Iterable[Path]:
    return Path(os.environ.get(variable, "").split(os.pathsep)[0]).glob(f"**/{SIGNALS}")


if __name__ == "__main__":
    sys.exit(main())
