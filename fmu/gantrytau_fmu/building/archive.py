"""FMUs and systems of them as ZIP archives: where the binaries stand, and writing all or nothing."""

import os
import stat
import struct
import zipfile
from collections.abc import Mapping
from pathlib import Path

from gantrytau.border.refusal import ModelError
from gantrytau.whole_files import replacing
from gantrytau_fmu.building.platforms import PLATFORMS, Platform

_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest that ZIP knows; the same content gives the same bytes


def binary_path(platform: Platform, fmi: str, identifier: str) -> str:
    """Where the library of a platform stands in an FMU."""
    folder = platform.folder_2 if fmi == "2.0" else platform.folder_3
    return f"binaries/{folder}/{identifier}{platform.suffix}"


def binary_members(libraries: Mapping[Platform, bytes], fmi: str, identifier: str) -> dict[str, bytes]:
    """The members that hold the libraries.

    For arm64 the standard of FMI 2 says e.g. `aarch64-darwin`, but FMPy and OpenModelica look into `darwin64`
    or `linux64` there. So these folders hold the arm64 library, too: on macOS both processors in one
    universal file, elsewhere unless there is one for x86-64.
    """
    members = {binary_path(platform, fmi, identifier): data for platform, data in libraries.items()}
    if fmi == "2.0":
        data = {platform.name: library for platform, library in libraries.items()}
        for system in ("linux", "windows", "darwin"):
            arm, intel = data.get(f"aarch64-{system}"), data.get(f"x86_64-{system}")
            path = binary_path(PLATFORMS[f"x86_64-{system}"], fmi, identifier)
            if arm is not None and intel is None:
                members[path] = arm
            elif arm is not None and intel is not None and system == "darwin":
                members[path] = universal(intel, arm)
    return members


def universal(x86_64: bytes, arm64: bytes) -> bytes:
    """A Mach-O library for both processors: header and entries in big-endian order, then the two files."""
    align = 14  # 2^14 bytes, the page of arm64
    offset, entries, body = 1 << align, [], b""
    # (CPU type, subtype): x86-64 and all of them, arm64 and all of them
    for (kind, subtype), data in zip(((0x01000007, 3), (0x0100000C, 0)), (x86_64, arm64), strict=True):
        entries.append(struct.pack(">5I", kind, subtype, offset + len(body), len(data), align))
        body += data + bytes(-len(data) % (1 << align))
    return (struct.pack(">2I", 0xCAFEBABE, 2) + b"".join(entries)).ljust(offset, b"\0") + body


def write_archive(
    path: str | os.PathLike[str],
    members: Mapping[str, bytes],
    *,
    suffix: str = ".fmu",
    first: str = "modelDescription.xml",
    overwrite: bool = True,
) -> Path:
    """Write members, name -> content, into a ZIP archive, by default an FMU, that appears whole or not at all.

    suffix: what `path` must end with; first: the member that comes first, the others follow by name. The same
    members give the same bytes.

    Raises ModelError if the path cannot be written or has another suffix, or if it exists and `overwrite` is
    false.
    """
    path = check_target(path, suffix, overwrite=overwrite)
    try:
        with replacing(path) as partial:
            _write(partial, members, first)
    except OSError as error:
        raise _unwritable(path, error) from error
    return path


def check_target(path: str | os.PathLike[str], suffix: str = ".fmu", *, overwrite: bool = True) -> Path:
    """The path of an archive, refused before any work is done for it; ModelError as in `write_archive`."""
    path = Path(path)
    try:
        if path.is_dir():
            raise ModelError(
                f"{path}: found a folder, expected a file that ends in '{suffix}'; name a file in it"
            )
        if path.suffix.lower() != suffix:
            raise ModelError(
                f"{path}: found the suffix '{path.suffix}', expected '{suffix}'; call it {path.stem}{suffix}"
            )
        if path.exists() and not overwrite:
            raise ModelError(f"{path}: found a file, expected none; choose another name, or overwrite=True")
        with replacing(path) as partial:
            partial.touch()
            raise _Writable
    except _Writable:  # and nothing is left of the trial
        return path
    except (OSError, ValueError) as error:  # ValueError: no file can have this name
        raise _unwritable(path, error) from error


class _Writable(Exception):
    """A trial went well."""


def _unwritable(path: Path, error: Exception) -> ModelError:
    reason = getattr(error, "strerror", None) or str(error)
    return ModelError(
        f"{path}: cannot be written ({reason}), expected a folder that may be written to and has room; "
        "name another one, or change its permissions"
    )


def _write(path: Path, members: Mapping[str, bytes], first: str) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name in sorted(members, key=lambda name: (name != first, name)):
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.create_system = 3  # Unix, wherever it is written
            entry.external_attr = (stat.S_IFREG | 0o644) << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, members[name])
