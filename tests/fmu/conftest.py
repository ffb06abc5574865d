"""Exported FMUs, each made once in a session."""

from collections.abc import Callable

import pytest

from gantrytau import translate
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
