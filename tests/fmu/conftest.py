"""Exported FMUs, each made once in a session, with libraries that may have been compiled before."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from gantrytau import translate
from gantrytau_fmu.building.platforms import Platform
from tests.fmu.binaries_kept import libraries, remove_old
from tests.fmu.exported import MODELS, Exported, export


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
