"""The pages that people wrote, staged for Sphinx: those of the site, and those that stand in the folders of the sources.

Links lead from file to file in the repository, so that they work there; on the site they lead to the page of the file, or
to a copy of it where it has none.
"""

import os
import re
import shutil
from pathlib import Path

from notebooks.site.builder.generated.reference_pages import resolver
from notebooks.site.builder.places import NOTEBOOKS, ROOT, SOURCES, STAGE

MANUAL = {  # page of a folder -> page of the site
    "README.md": "manual/overview.md",
    "gantrytau/README.md": "manual/gantrytau.md",
    "gantrytau/mechanics/README.md": "manual/mechanics.md",
    "gantrytau/blocks/README.md": "manual/blocks.md",
    "gantrytau/electrical/README.md": "manual/electrical.md",
    "gantrytau/kinematics/README.md": "manual/kinematics.md",
    "gantrytau/ensembles/README.md": "manual/ensembles.md",
    "models/README.md": "manual/models.md",
    "optimica/README.md": "manual/optimica.md",
    "optimica/gantrytau_optimica/fitting/README.md": "manual/fitting.md",
    "fmu/README.md": "manual/fmu.md",
    "fmu/PROTOCOL.md": "manual/protocol.md",
    "notebooks/README.md": "notebooks/index.md",
    "tests/README.md": "manual/tests.md",
    "CONTRIBUTING.md": "manual/contributing.md",
    "CHANGELOG.md": "manual/changelog.md",
}
UNSEARCHED = {"manual/changelog.md"}  # names everything, and explains nothing
GENERATED = (
    "reference",
    "messages",
    "thesis",
    "library",
    "classics",
    "command_line",
    "sources",
    "gallery",
)  # folders of pages that nobody writes
LINK = re.compile(  # or code, in which nothing is one
    r"^```.*?^```|(!?\[(?:`[^`\n]*`|[^\]`])*\]\()([^)\s]+)(\))|`[^`\n]+`", re.MULTILINE | re.DOTALL
)
NAMED = re.compile(r"(?<!`)`([A-Za-z_]\w+)(\([^`]*\)|)`(?!`)")


class Stage:
    """The folder that Sphinx reads. What is written again as it was keeps its time, so that only what changed is built."""

    def __init__(self, folder: Path = STAGE):
        self.folder = folder
        self.written = set[Path]()

    def write(self, page: str, text: str) -> None:
        """A page by its path below the root of the site."""
        path = self._path(page)
        if not (path.exists() and path.read_text(encoding="utf-8") == text):
            path.write_text(text, encoding="utf-8")

    def copy(self, source: Path, page: str) -> None:
        """A file as it is."""
        path = self._path(page)
        if not (path.exists() and path.read_bytes() == source.read_bytes()):
            shutil.copyfile(source, path)

    def clear(self) -> None:
        """Removes what an earlier build wrote and this one did not."""
        for path in sorted(self.folder.rglob("*"), reverse=True):
            if path.is_file() and path not in self.written:
                path.unlink()
            elif path.is_dir() and not any(path.iterdir()):
                path.rmdir()

    def _path(self, page: str) -> Path:
        path = self.folder / page
        path.parent.mkdir(parents=True, exist_ok=True)
        self.written.add(path)
        return path


def handwritten() -> dict[Path, str]:
    """Files in the repository, and the pages of the site that they become."""
    own = {path: path.relative_to(SOURCES).as_posix() for path in sorted(SOURCES.rglob("*.md"))}
    manual = {ROOT / path: page for path, page in MANUAL.items() if (ROOT / path).exists()}
    notebooks = {path: f"notebooks/{path.stem}.ipynb" for path in sorted(NOTEBOOKS.glob("*.py"))}
    return own | manual | notebooks


def stage_handwritten(stage: Stage) -> None:
    """Stages all pages in Markdown and what they link to."""
    pages = handwritten()
    for path, page in pages.items():
        if path.suffix == ".md":
            text = relinked(path.read_text(encoding="utf-8"), path, page, stage)
            head = "---\nnosearch: true\n---\n" if page in UNSEARCHED else ""
            stage.write(page, head + _with_names(text) + _tree_of(page))


def relinked(text: str, source: Path, page: str, stage: Stage) -> str:
    """A text whose links lead to pages of the site, or to files that are staged for it; ValueError for one to nothing."""
    pages = handwritten()

    def there(found: re.Match[str]) -> str:
        target, _, anchor = (found[2] or "").partition("#")
        if not target or re.match(r"[a-z]+:", target):
            return found[0]
        path = (source.parent / target).resolve()
        if path.is_dir() and (path / "README.md") in pages:
            path = path / "README.md"
        if path in pages:
            place = pages[path]
        elif any(path.is_relative_to(SOURCES / part) for part in GENERATED):
            return found[0]
        elif path.is_file() and path.is_relative_to(ROOT):
            place = f"files/{path.relative_to(ROOT).as_posix()}"
            stage.copy(path, place)
        else:
            raise ValueError(f"{source}: found a link to {target}, expected a file that is there; mend it")
        way = os.path.relpath(place, Path(page).parent)
        return f"{found[1]}{way}{f'#{anchor}' if anchor else ''}{found[3]}"

    return LINK.sub(there, text)


def _with_names(text: str) -> str:
    """A page on which code that is a public name leads to the reference: a class, or a function with its parentheses."""
    link, lines = resolver(""), text.splitlines(keepends=True)
    fenced = False
    for number, line in enumerate(lines):
        fenced ^= line.lstrip().startswith("```")
        if fenced or line.startswith("#"):
            continue
        parts = NAMED.split(line)
        for k in range(1, len(parts), 3):
            before = "".join(parts[:k])
            name, rest = parts[k], parts[k + 1]
            target = link(name) if before.rfind("[") <= before.rfind("]") else None
            whole = target and not set(rest) & set("<>`") and (rest or name[0].isupper())
            parts[k] = f"{{py:obj}}`{name}{rest} <{target}>`" if whole else f"`{name}{rest}`"
            parts[k + 1] = ""
        lines[number] = "".join(parts)
    return "".join(lines)


def _tree_of(page: str) -> str:
    """The notebooks as files for Jupyter, with their outputs, and the tree below their page."""
    if page != "notebooks/index.md":
        return ""
    names = [path.stem for path in sorted(NOTEBOOKS.glob("*.py"))]
    files = ", ".join(f"{{download}}`{name}.ipynb`" for name in names)
    tree = "\n".join(names)
    return f"\nFor Jupyter, with their outputs: {files}.\n\n```{{toctree}}\n:hidden:\n\n{tree}\n```\n"
