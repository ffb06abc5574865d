"""Where things stand: the repository, its packages, and what a build writes."""

from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
SOURCES = ROOT / "notebooks" / "site"
NOTEBOOKS = ROOT / "notebooks"
BUILD = ROOT / "build" / "docs"
STAGE = BUILD / "pages"  # all that Sphinx reads
EXECUTED = BUILD / "executed"  # notebooks with their outputs
DRAWN = BUILD / "drawn"  # pictures and equations of examples
SITE = ROOT / "build" / "site"
PACKAGES = {
    "gantrytau": ROOT / "gantrytau",
    "gantrytau_models": ROOT / "models" / "gantrytau_models",
    "gantrytau_optimica": ROOT / "optimica" / "gantrytau_optimica",
    "gantrytau_fmu": ROOT / "fmu" / "gantrytau_fmu",
}


def module_name(path: Path) -> str:
    """The dotted name of a module of the packages; a package has the name of its folder."""
    for package, folder in PACKAGES.items():
        if path.is_relative_to(folder):
            parts = (package, *path.relative_to(folder).with_suffix("").parts)
            return ".".join(parts).removesuffix(".__init__")
    raise ValueError(f"{path}: expected a file of one of {', '.join(PACKAGES)}")


@cache
def modules() -> dict[str, Path]:
    """All modules of the packages, by dotted name."""
    files = (path for folder in PACKAGES.values() for path in sorted(folder.rglob("*.py")))
    return {module_name(path): path for path in files}
