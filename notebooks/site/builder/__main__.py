"""`python -m notebooks.site.builder`: builds the site into build/site, and fails on any warning and broken link."""

import argparse
import shutil
import subprocess
import sys
import time

from notebooks.site.builder.broken_links import broken_links
from notebooks.site.builder.executed_notebooks import executed_notebooks
from notebooks.site.builder.gallery.drawn_examples import drawn_examples
from notebooks.site.builder.generated.classics_page import classics_page
from notebooks.site.builder.generated.command_page import command_page
from notebooks.site.builder.generated.error_pages import error_pages
from notebooks.site.builder.generated.gallery_page import gallery_page
from notebooks.site.builder.generated.library_page import library_page
from notebooks.site.builder.generated.reference_pages import reference_pages
from notebooks.site.builder.generated.source_page import source_page
from notebooks.site.builder.generated.thesis_page import pictures, thesis_pages
from notebooks.site.builder.places import BUILD, NOTEBOOKS, SITE, SOURCES, STAGE
from notebooks.site.builder.staging import Stage, stage_handwritten
from notebooks.site.builder.thesis_runs import made


def main() -> int:
    """Stages, executes, builds, checks."""
    parser = argparse.ArgumentParser(prog="make docs", description=__doc__)
    parser.add_argument(
        "--without-outputs", action="store_true", help="execute no notebooks and calls: a quick look"
    )
    asked = parser.parse_args()
    begin = time.monotonic()
    stage = Stage()
    stage_handwritten(stage)
    drawn = drawn_examples()
    for name, one in drawn.items():
        stage.copy(one.picture, f"gallery/{name}.png")
    told(begin, f"{len(drawn)} examples drawn")
    single = {
        "gallery/index.md": gallery_page(drawn),
        "library/index.md": library_page(),
        "classics/index.md": classics_page(),
        "command_line/index.md": command_page(),
        "sources/index.md": source_page(),
    }
    for page, text in (*reference_pages(drawn), *error_pages(), *single.items()):
        stage.write(page, text)
    told(begin, f"{len(stage.written)} pages staged; calls of the thesis are executed")
    _stage_thesis(stage, asked.without_outputs)
    told(begin, "notebooks are executed")
    _stage_notebooks(stage, asked.without_outputs)
    stage.clear()
    told(begin, "Sphinx builds the pages")
    if _sphinx():
        return 1
    wrong = list(broken_links(SITE))
    print("\n".join(wrong), end="\n" if wrong else "", file=sys.stderr)
    told(begin, f"{len(wrong)} broken links" if wrong else f"the site is {SITE / 'index.html'}")
    return 1 if wrong else 0


def _stage_thesis(stage: Stage, without_outputs: bool) -> None:
    found = {} if without_outputs else dict(made())
    for page, text in thesis_pages(found):
        stage.write(page, text)
    for item, one in found.items():
        for path, name in zip(one.pictures, pictures(item, one), strict=True):
            stage.copy(path, f"thesis/{name}")


def _stage_notebooks(stage: Stage, without_outputs: bool) -> None:
    if without_outputs:
        import jupytext

        for path in sorted(NOTEBOOKS.glob("*.py")):
            stage.write(f"notebooks/{path.stem}.ipynb", jupytext.writes(jupytext.read(path), fmt="ipynb"))
        return
    for path, file in executed_notebooks().items():
        stage.copy(file, f"notebooks/{path.stem}.ipynb")


def _sphinx() -> int:
    for stale in SITE.glob("**/*.html"):
        if not (STAGE / stale.relative_to(SITE)).with_suffix("").parent.exists():
            shutil.rmtree(SITE)
            break
    options = ["-b", "html", "-W", "--keep-going", "-q", "-j", "auto", "-d", str(BUILD / "doctrees")]
    return subprocess.call(
        [sys.executable, "-m", "sphinx", *options, "-c", str(SOURCES), str(STAGE), str(SITE)]
    )


def told(begin: float, words: str) -> None:
    """Says how far it is."""
    print(f"{time.monotonic() - begin:5.0f} s  {words}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
