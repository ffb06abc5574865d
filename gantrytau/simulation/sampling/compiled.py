"""A function as machine code of this computer, where it has a C compiler: the same numbers, many times faster."""

import shutil
import subprocess
import tempfile
from pathlib import Path

import casadi as ca

FLAGS = ("-O2", "-fPIC", "-shared", "-ffp-contract=off")  # no sum is rounded otherwise than by CasADi
MOST = 60.0  # s, for the compiler


def compiled(function: ca.Function) -> ca.Function | None:
    """The function compiled, or None where there is no compiler, or it does not succeed."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        generator = ca.CodeGenerator("function.c")
        generator.add(function)
        generator.generate(f"{name}/")
        source, library = (Path(name) / f"function.{suffix}" for suffix in ("c", "so"))
        try:
            command = [compiler, *FLAGS, str(source), "-o", str(library), "-lm"]
            subprocess.run(command, check=True, capture_output=True, timeout=MOST)
            return ca.external(function.name(), str(library))
        except (subprocess.SubprocessError, OSError, RuntimeError):
            return None
