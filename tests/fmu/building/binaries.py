"""What shared libraries export and import, read from their bytes: ELF, PE and Mach-O, 64-bit little-endian."""

import re
import struct
from collections.abc import Iterator


def exports(library: bytes) -> set[str]:
    """The names that a library shows to those who load it."""
    if library[:4] == b"\x7fELF":
        # local symbols and undefined ones (section 0) are not offered
        return {name for name, info, section in _elf_symbols(library) if info >> 4 and section}
    if library[:2] == b"MZ":
        return _pe_exports(library)
    # N_SECT and N_EXT without N_PEXT; zig's linker shows two names of its own, which mean the image they are in
    own = {"__mh_dylib_header", "___dso_handle"}
    names = {name for name, kind in _macho_symbols(library) if kind & 0x1F == 0x0F}
    return {name.removeprefix("_") for name in names - own}


def imported_libraries(library: bytes) -> set[str]:
    """The files that a library needs."""
    if library[:4] == b"\x7fELF":
        texts = _elf_section(library, ".dynstr")
        dynamic = struct.iter_unpack("<qQ", _elf_section(library, ".dynamic"))
        return {_text(texts, value) for tag, value in dynamic if tag == 1}
    if library[:2] == b"MZ":
        return _pe_imports(library)
    return {_command_text(data) for kind, data in _macho_commands(library) if kind == 0xC}  # LC_LOAD_DYLIB


def glibc_versions(library: bytes) -> set[tuple[int, ...]]:
    """The versions of glibc's symbols that an ELF library needs."""
    found = re.findall(rb"GLIBC_([0-9.]+)\0", _elf_section(library, ".dynstr"))
    return {tuple(int(part) for part in version.split(b".")) for version in found}


def install_name(library: bytes) -> str:
    """How a Mach-O library calls itself (LC_ID_DYLIB)."""
    return next(_command_text(data) for kind, data in _macho_commands(library) if kind == 0xD)


def _text(data: bytes, place: int) -> str:
    return data[place : data.index(b"\0", place)].decode()


def _elf_section(library: bytes, wanted: str) -> bytes:
    table, size, count, names = (
        *struct.unpack_from("<Q", library, 40),
        *struct.unpack_from("<3H", library, 58),
    )
    headers = [struct.unpack_from("<IIQQQQ", library, table + k * size) for k in range(count)]
    texts = library[headers[names][4] :]
    for name, _, _, _, offset, length in headers:
        if _text(texts, name) == wanted:
            return library[offset : offset + length]
    raise KeyError(wanted)


def _elf_symbols(library: bytes) -> Iterator[tuple[str, int, int]]:
    """Name, info (binding in the upper half) and section of the dynamic symbols."""
    texts = _elf_section(library, ".dynstr")
    for name, info, _, section, _, _ in struct.iter_unpack("<IBBHQQ", _elf_section(library, ".dynsym")):
        yield _text(texts, name), info, section


def _pe_place(library: bytes, address: int) -> int:
    """The place in the file of an address relative to the image."""
    header = struct.unpack_from("<I", library, 0x3C)[0]
    count, optional = (
        struct.unpack_from("<H", library, header + 6)[0],
        struct.unpack_from("<H", library, header + 20)[0],
    )
    for k in range(count):
        size, start, _, offset = struct.unpack_from("<4I", library, header + 24 + optional + 40 * k + 8)
        if start <= address < start + size:
            return address - start + offset
    raise KeyError(address)


def _pe_directory(library: bytes, number: int) -> int:
    header = struct.unpack_from("<I", library, 0x3C)[0]
    return _pe_place(library, struct.unpack_from("<I", library, header + 24 + 112 + 8 * number)[0])


def _pe_exports(library: bytes) -> set[str]:
    directory = _pe_directory(library, 0)
    count, _, names = struct.unpack_from("<3I", library, directory + 24)
    table = _pe_place(library, names)
    addresses = struct.unpack_from(f"<{count}I", library, table)
    return {_text(library, _pe_place(library, address)) for address in addresses}


def _pe_imports(library: bytes) -> set[str]:
    place, found = _pe_directory(library, 1), set()
    while name := struct.unpack_from("<I", library, place + 12)[0]:
        found.add(_text(library, _pe_place(library, name)))
        place += 20
    return found


def _macho_commands(library: bytes) -> Iterator[tuple[int, bytes]]:
    magic, count = struct.unpack_from("<I", library)[0], struct.unpack_from("<I", library, 16)[0]
    assert magic == 0xFEEDFACF
    place = 32
    for _ in range(count):
        kind, size = struct.unpack_from("<2I", library, place)
        yield kind, library[place : place + size]
        place += size


def _command_text(command: bytes) -> str:
    return _text(command + b"\0", struct.unpack_from("<I", command, 8)[0])


def _macho_symbols(library: bytes) -> Iterator[tuple[str, int]]:
    """Name and type of the symbols (LC_SYMTAB)."""
    command = next(data for kind, data in _macho_commands(library) if kind == 2)
    symbols, count, texts, _ = struct.unpack_from("<4I", command, 8)
    for k in range(count):
        name, kind = struct.unpack_from("<IB", library, symbols + 16 * k)
        yield _text(library[texts:], name), kind
