"""Shared libraries of an FMU: for which systems and processors they are, by their first bytes."""

import struct
from collections.abc import Iterator

from gantrytau_fmu.building.platforms import ALIASES

FOLDERS = ALIASES | {"linux32": "x86-linux", "win32": "x86-windows", "darwin32": "x86-darwin"}
HEAD = 4096  # bytes that tell it
_FORMATS = {"linux": "ELF", "windows": "PE", "darwin": "Mach-O"}
_MACHINES = {
    "ELF": {62: "x86_64", 183: "aarch64", 3: "x86"},
    "PE": {0x8664: "x86_64", 0xAA64: "aarch64", 0x14C: "x86"},
    "Mach-O": {0x01000007: "x86_64", 0x0100000C: "aarch64", 7: "x86"},
}


def platforms_of(folder: str, head: bytes) -> tuple[str, ...]:
    """The platforms, in the names of FMI 3, that a library in `binaries/folder` serves.

    A folder of FMI 2 such as darwin64 says no more than the system: its library may be for another processor, or for
    several. Where the first bytes do not tell, the folder is believed.
    """
    platform = FOLDERS.get(folder, folder)
    system = platform.partition("-")[2]
    if folder not in ALIASES or form_of(head) != _FORMATS[system]:
        return (platform,)
    return tuple(f"{processor}-{system}" for processor in processors(head)) or (platform,)


def misplaced(folder: str, head: bytes) -> str:
    """What is wrong with a library in `binaries/folder`, or nothing."""
    platform = FOLDERS.get(folder, folder)
    processor, _, system = platform.partition("-")
    expected = _FORMATS.get(system)
    if expected and form_of(head) != expected:
        return f"this is no {expected} file, expected a shared library for {platform}"
    found = processors(head)
    if found and folder not in ALIASES and processor in _MACHINES["ELF"].values() and processor not in found:
        return f"this library is for another processor ({', '.join(found)}), expected {platform}"
    return ""


def form_of(head: bytes) -> str:
    """ELF, PE, Mach-O or nothing."""
    if head.startswith(b"\x7fELF"):
        return "ELF"
    if head.startswith(b"MZ"):
        return "PE"
    known = (b"\xcf\xfa\xed\xfe", b"\xce\xfa\xed\xfe", b"\xca\xfe\xba\xbe")
    return "Mach-O" if head.startswith(known) else ""


def processors(head: bytes) -> tuple[str, ...]:
    """The processors a library is for, as far as they are known."""
    form = form_of(head)
    try:
        found = tuple(_machines(form, head))
    except struct.error:  # too short
        return ()
    return tuple(_MACHINES[form][machine] for machine in found if machine in _MACHINES[form])


def _machines(form: str, head: bytes) -> Iterator[int]:
    if form == "ELF":
        yield from struct.unpack_from("<H", head, 18)
    elif form == "PE":
        (start,) = struct.unpack_from("<I", head, 0x3C)
        yield from struct.unpack_from("<H", head, start + 4)
    elif head.startswith(b"\xca\xfe\xba\xbe"):  # several, with entries of 20 bytes
        (count,) = struct.unpack_from(">I", head, 4)
        for k in range(min(count, 10)):
            yield from struct.unpack_from(">I", head, 8 + 20 * k)
    elif form == "Mach-O":
        yield from struct.unpack_from("<I", head, 4)
