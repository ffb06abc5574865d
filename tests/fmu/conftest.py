"""Exported FMUs, each made once in a session, with libraries that may have been compiled before."""

import re
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from zlib import crc32

import pytest

from gantrytau import translate
from gantrytau_fmu.building.platforms import Platform
from tests.fmu.binaries_kept import libraries, remove_old
from tests.fmu.exported import MODELS, Exported, export

HERE = Path(__file__).parent


VERSION = re.compile(r"(?<![\w.])(fmi)?[23](\.0)?(?![\w.])")  # of FMI, in the name of a case


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """A case in both versions of FMI is one family: some run in FMI 2, the others in FMI 3, nightly all in both."""
    families = defaultdict(list)
    for item in items:
        case = getattr(item, "callspec", None)
        if case and {"version", "fmi", "fmu"} & case.params.keys() and item.path.is_relative_to(HERE):
            families[VERSION.sub("", item.nodeid.rpartition("::")[2], count=1), item.path.name].append(item)
    for case, family in families.items():
        if len(family) == 2 and not any(item.get_closest_marker("nightly") for item in family):
            family[crc32(repr(case).encode()) % 2].add_marker("nightly")


@pytest.fixture(scope="session")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Exported]:
    """`exported("six-link", 2)`: a model of MODELS as FMU; further keywords go to export_fmu."""
    daes, found = {}, {}

    def get(name: str, version: int = 3, **options) -> Exported:
        key = (name, version, *sorted(options.items()))
        if name not in daes:
            daes[name] = translate(MODELS[name](), events=True)
        if key not in found:
            path = tmp_path_factory.mktemp("exported") / "model.fmu"
            found[key] = export(daes[name], path, version, **options)  # pyright: ignore[reportArgumentType]
        return found[key]

    return get


@pytest.fixture(scope="module", autouse=True)
def kept_libraries() -> Iterator[None]:
    """The same sources are compiled once, in a third of the usual time; -O0 rounds as -O1 does.

    Tests of the compilation itself call it directly; commands, pages and notebooks compile as users do.
    """

    def quickly(*sources: Any, **policy: Any) -> dict[Platform, bytes]:
        return libraries(*sources, **policy | {"optimisation": "-O0"})

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gantrytau_fmu.export.compile_libraries", quickly)
        yield
    remove_old()
