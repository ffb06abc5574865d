"""Archives of others: refused before anything of them is unpacked, parsed or loaded if they could do harm.

An FMU or SSP is a zip file. Its directory says what is in it, and may lie: names that lead out of the folder, links,
sizes that are too small. So the directory is checked first, and all that is unpacked is counted again.
Compression: stored or deflate, as FMI 2.0.4, section 2.3, and FMI 3.0.2, section 2.5.1, ask for.
"""

import os
import re
import shutil
import stat
import struct
import unicodedata
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BufferedReader, FileIO
from pathlib import Path

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau_fmu.reading.safe_xml import check_xml

DESCRIPTION = "modelDescription.xml"
_MAGIC = b"PK"  # of every zip archive
_AGAIN = "export or fetch the file again"
MEMBERS = 5_000  # entries that an archive may have
UNPACKED = 200_000_000  # bytes, of all members together
XML = 64_000_000  # bytes of one XML file, about 200 thousand variables
_DIRECTORY = 4_000_000  # bytes, 800 for each entry
_CHUNK = 1 << 16
_END = 22 + 65_535  # bytes at the end of the file, with the longest comment
_HEADER = 30  # bytes before each member, besides its name
_NAME = 255  # bytes that file systems allow for one part of a path
_PATH = 1_000  # bytes of a whole path

_RESERVED = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[0-9¹²³])\s*(\..*)?", re.IGNORECASE)
_FORBIDDEN = re.compile(r'[\x00-\x1f\x7f<>:"|?*\ud800-\udfff]')
_REPARSE_POINT = 0x400  # attribute of links on Windows
_ENCRYPTED = 0x1 | 0x40 | 0x2000  # flags: by password, strongly, with a masked directory
_BROKEN = (  # what Python raises for archives that are not what they should be
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
    struct.error,
    EOFError,
    LookupError,
    NotImplementedError,
    RuntimeError,
    ValueError,
    OverflowError,
    OSError,  # places before the begin of the file
)


@dataclass(frozen=True)
class Archive:
    """An archive whose directory has been checked, open while the context of `open_archive` lasts.

    names: of its members, folders left out; size: bytes of all members.
    """

    names: tuple[str, ...]
    size: int
    _zip: zipfile.ZipFile = field(repr=False)

    def read(self, name: str, limit: int = UNPACKED) -> bytes:
        """A member whole. ModelError if it is not there, damaged, or has more than `limit` bytes."""
        if name not in self.names:
            raise ModelError(f"there is no '{name}' in it, expected one; {_AGAIN}")
        found = bytearray()
        for chunk in self.chunks(name):
            found += chunk
            if len(found) > limit:
                raise ModelError(f"'{name}' has more than {limit:,} bytes, expected no more; it is not read")
        return bytes(found)

    def xml(self, name: str) -> bytes:
        """A member that is XML without a document type. ModelError if it is damaged, too large, or something else."""
        text = self.read(name, XML)
        check_xml(text, f"'{name}'")
        return text

    def chunks(self, name: str) -> Iterator[bytes]:
        """A member piece by piece. ModelError if it is damaged."""
        with _translated(f"member '{name}'"), self._zip.open(name) as member:
            while chunk := member.read(_CHUNK):
                yield chunk

    def verify(self) -> None:
        """Read everything once. ModelError for damage, and for more than `UNPACKED` bytes."""
        count = 0
        for name in self.names:
            for chunk in self.chunks(name):
                count = self._counted(count, chunk)

    def unpack(self, folder: Path) -> None:
        """Write all members below `folder`. ModelError as in `verify`; what was written until then stays."""
        count = 0
        for name in self.names:
            target = folder.joinpath(*name.split("/"))
            target.parent.mkdir(parents=True, exist_ok=True)
            with target.open("xb") as file:
                for chunk in self.chunks(name):
                    count = self._counted(count, chunk)
                    file.write(chunk)

    def _counted(self, count: int, chunk: bytes) -> int:
        if count + len(chunk) > UNPACKED:
            raise ModelError(_too_large(count + len(chunk)))
        return count + len(chunk)


@contextmanager
def open_archive(
    path: str | os.PathLike[str], needs: str = DESCRIPTION, verify: bool = True
) -> Iterator[Archive]:
    """The archive `path`, an FMU or with another `needs` an SSP, once its directory is found harmless.

    needs: the member that makes it what it is; verify: whether to read everything once, so that damage shows.

    Raises ModelError for a file that is not there, no zip archive, damaged, encrypted or cut off; for members with
    unsafe or doubtful names, links, more than 5,000 entries, more than 200 MB; and if `needs` is not among them.
    `located` names the file in it.
    """
    path = Path(path)
    if not path.is_file():
        raise ModelError(_no_file(path))
    with _opened(path, "SSP" if needs.endswith(".ssd") else "FMU") as archive:
        infos = archive.infolist()
        _check_directory(infos)
        _check_count(archive, len(infos))
        names = tuple(info.filename for info in infos if not info.is_dir())
        _check_content(names, needs)
        found = Archive(names, sum(info.file_size for info in infos), archive)
        if verify:
            found.verify()
        yield found


def unpack(path: str | os.PathLike[str], folder: str | os.PathLike[str], needs: str = DESCRIPTION) -> Path:
    """Unpack an FMU (or with another `needs` an SSP) into a folder, which is new or empty; the folder.

    Raises ModelError as `extract`, which names the file.
    """
    with located(path):
        return extract(path, Path(folder), needs)


def extract(path: str | os.PathLike[str], folder: Path, needs: str = DESCRIPTION) -> Path:
    """As `unpack`, but its errors leave it to `located` to name the file.

    Raises ModelError as `open_archive`, for a folder that holds something, and if it cannot be written.
    Whatever ends the unpacking early, nothing of it is left.
    """
    with open_archive(path, needs, verify=False) as archive:
        existed = folder.is_dir()
        try:
            if existed and any(folder.iterdir()):
                raise ModelError(
                    f"{folder}: found files in this folder, expected an empty one to unpack into"
                )
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise ModelError(_unwritable(folder, error)) from error
        try:
            archive.unpack(folder)
        except BaseException as error:  # Ctrl-C, too
            _empty(folder, keep=existed)
            if isinstance(error, OSError):
                raise ModelError(_unwritable(folder, error)) from error
            raise
    return folder


@contextmanager
def located(path: str | os.PathLike[str]) -> Iterator[None]:
    """Errors inside name the file that they are of."""
    try:
        yield
    except ModelError as error:
        raise error.within(os.fspath(path)) from error


class _Guarded(BufferedReader):
    """A file that is not read in large pieces: Python reads the directory of an archive whole."""

    def read(self, size: int | None = -1, /) -> bytes:
        if size is not None and size > _DIRECTORY:
            raise zipfile.BadZipFile(f"its directory has {size:,} bytes, expected at most {_DIRECTORY:,}")
        return super().read(size)


@contextmanager
def _opened(path: Path, what: str) -> Iterator[zipfile.ZipFile]:
    """The file as zip archive; ModelError if it is none or too large to be one within the limits. what: wanted."""
    try:
        file = _Guarded(FileIO(path))
    except OSError as error:
        raise ModelError(f"cannot be read ({error.strerror}); check its permissions") from error
    with file:
        size = os.fstat(file.fileno()).st_size
        if size == 0:
            raise ModelError(f"found an empty file, expected a zip archive; {_AGAIN}")
        if size > UNPACKED + _DIRECTORY + MEMBERS * 128:
            raise ModelError(_too_large(size))
        if not zipfile.is_zipfile(file) and not _MAGIC.startswith(head := _head(file)):
            raise ModelError(
                f"found the beginning '{_letters(head)}', expected '{_letters(_MAGIC)}': this is no ZIP "
                f"archive, so no {what}; check that it is the right file"
            )
        with _translated("directory"):
            archive = zipfile.ZipFile(file)
        with archive:
            yield archive


def _head(file: BufferedReader) -> bytes:
    file.seek(0)
    return file.read(len(_MAGIC))


@contextmanager
def _translated(what: str) -> Iterator[None]:
    """What Python says of a damaged archive as ModelError."""
    try:
        yield
    except _BROKEN as error:
        words = str(error) or type(error).__name__
        raise ModelError(
            f"found a damaged {what} ({words}), expected a sound zip archive; {_AGAIN}"
        ) from error


def _check_directory(infos: list[zipfile.ZipInfo]) -> None:
    """ModelError for what the directory of an archive says and must not say."""
    if len(infos) > MEMBERS:
        raise ModelError(
            f"found {len(infos):,} entries, expected at most {MEMBERS:,}; "
            "unpack it yourself if you trust it, and leave out what is not needed"
        )
    for info in infos:
        if wrong := _wrong_name(info.orig_filename) or _wrong_name(info.filename) or _wrong_kind(info):
            raise ModelError(f"member {_shown(info.orig_filename)} {wrong}; do not trust this file")
    if (size := sum(info.file_size for info in infos)) > UNPACKED:
        raise ModelError(_too_large(size))
    _check_places(infos)


def _check_count(archive: zipfile.ZipFile, count: int) -> None:
    """ModelError unless the end of the file counts as many entries as were found: damage can hide some."""
    file = archive.fp
    assert file is not None
    file.seek(max(0, file.seek(0, os.SEEK_END) - _END))
    end = file.read(_END)
    place = end.rfind(b"PK\5\6")
    (told,) = struct.unpack_from("<H", end, place + 10)
    if told not in (count, 0xFFFF):  # the latter where an extension tells it
        raise ModelError(f"found {count} entries where its end tells of {told}, expected as many; {_AGAIN}")


def _wrong_name(name: str) -> str:
    """What is wrong with the name of a member, in words; "" if it is harmless on every system."""
    if "\\" in name:
        return "has a backslash in its name, expected '/' between folders"
    if name.startswith("/") or re.match(r"[A-Za-z]:", name):
        return "has an absolute path, expected a path inside the archive"
    if letter := _FORBIDDEN.search(name):
        return f"has the character {letter[0]!r} in its name, which not every system can store"
    parts = name.removesuffix("/").split("/")
    if ".." in parts:
        return "leads out of the archive, expected a path without '..'"
    if any(part in ("", ".") for part in parts):
        return "has an empty part or '.' in its path, expected plain names"
    if any(_RESERVED.fullmatch(part) for part in parts):
        return "has a name that Windows keeps for devices, expected another one"
    if any(part[-1] in " ." for part in parts):
        return "has a part that ends with a dot or a space, which Windows drops"
    encoded = [part.encode() for part in parts]
    if any(len(part) > _NAME for part in encoded) or sum(map(len, encoded)) > _PATH:
        return f"has a path that is too long, expected at most {_NAME} bytes a part and {_PATH} in all"
    return ""


def _wrong_kind(info: zipfile.ZipInfo) -> str:
    """What is wrong with a member that is neither file nor folder, or that cannot be read."""
    kind = stat.S_IFMT(info.external_attr >> 16)
    if kind == stat.S_IFLNK or info.external_attr & _REPARSE_POINT:
        return "is a symbolic link, expected files and folders only"
    if kind not in (0, stat.S_IFDIR if info.is_dir() else stat.S_IFREG):
        return "is a special file, expected files and folders only"
    if info.flag_bits & _ENCRYPTED:
        return "is encrypted, expected one that can be read without a password"
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        return f"is compressed by method {info.compress_type}, expected deflate (8) or none (0)"
    return ""


def _check_places(infos: list[zipfile.ZipInfo]) -> None:
    """ModelError for two members at one place, of the unpacked folder or of the file itself."""
    folders: dict[str, str] = {}
    files: dict[str, str] = {}
    for info in infos:
        name = info.filename
        if info.is_dir():
            folders[_folded(name)] = name
        elif (first := files.setdefault(_folded(name), name)) != name:
            raise ModelError(
                f"'{first}' and '{name}' differ only in case, expected names that all systems tell apart; "
                "rename one of them"
            )
        for end in range(len(name)):
            if name[end] == "/":
                folders[_folded(name[:end])] = name
    if len(files) < sum(not info.is_dir() for info in infos):
        names = [info.filename for info in infos]
        twice = next(name for name in names if names.count(name) > 1)
        raise ModelError(f"found '{twice}' twice, expected each member once; do not trust this file")
    if both := files.keys() & folders.keys():
        name = files[min(both)]
        raise ModelError(f"found '{name}' as file and as folder, expected one of them; {_AGAIN}")
    end = 0  # of the member before: bombs let many members share the same bytes
    for info in sorted(infos, key=lambda info: info.header_offset):
        if info.header_offset < end:
            raise ModelError(
                f"member {_shown(info.filename)} overlaps another one, expected members side by side; "
                "do not trust this file"
            )
        end = info.header_offset + _HEADER + info.compress_size


def _folded(name: str) -> str:
    """A name as systems see it that do not mind case or the way accents are written."""
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", name.strip("/")).casefold())


def _check_content(names: tuple[str, ...], needs: str) -> None:
    """ModelError unless the archive holds what makes it an FMU or an SSP."""
    if needs in names:
        return
    deeper = next((name for name in names if name.endswith(f"/{needs}")), None)
    if deeper:
        remedy = (
            f"it is at '{deeper}': pack the content of the folder '{Path(deeper).parent}', not the folder"
        )
    else:
        remedy = "check that it is the right file"
    raise ModelError(f"found no {needs} in it, expected one at the top; {remedy}")


def no_file(path: Path) -> str:
    """That there is no file of this name, with the nearest one as a question."""
    return f"{path}: {_no_file(path)}"


def _no_file(path: Path) -> str:
    if path.exists():
        what = "folder" if path.is_dir() else "special file"
        return f"found a {what} of this name, expected a file; check the path"
    there = sorted(file.name for file in path.parent.glob(f"*{path.suffix}") if file.is_file())
    return f"found no such file, expected an archive{did_you_mean(path.name, there)}"


def _too_large(size: int) -> str:
    return (
        f"found {size / 1e6:,.0f} MB or more, expected at most {UNPACKED / 1e6:,.0f} MB unpacked; "
        "unpack it yourself if you trust it, and leave out what is not needed"
    )


def _unwritable(folder: Path, error: OSError) -> str:
    return f"{folder}: cannot be written ({error.strerror}); name another folder, or make room"


def _shown(name: str) -> str:
    """A doubtful name so that it can be printed: short, without control characters."""
    text = name if len(name) <= 80 else f"{name[:77]}..."
    return ascii(text) if _FORBIDDEN.search(text) else f"'{text}'"


def _empty(folder: Path, keep: bool) -> None:
    """Remove what is in a folder, and itself unless `keep`."""
    for entry in folder.iterdir():
        if entry.is_dir() and not entry.is_symlink():
            shutil.rmtree(entry, ignore_errors=True)
        else:
            entry.unlink(missing_ok=True)
    if not keep:
        folder.rmdir()


def _letters(head: bytes) -> str:
    """Bytes as letters, others as their numbers."""
    return repr(head)[2:-1]
