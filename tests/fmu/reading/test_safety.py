"""Archives that could do harm are refused with a message, and leave nothing behind."""

import random
import stat
import struct
import zipfile
from io import BytesIO
from pathlib import Path

import pytest

from gantrytau import GantryTauError, ModelError
from gantrytau_fmu.reading import safety
from gantrytau_fmu.reading.safe_xml import check_xml
from gantrytau_fmu.reading.safety import DESCRIPTION, open_archive, unpack

XML = b'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription/>'


@pytest.fixture
def pack(tmp_path):
    """Write an archive from names (or ZipInfo) and contents: `pack({"a/b": b"..."})`."""

    def write(members, description=True, name="robot.fmu", compression=zipfile.ZIP_DEFLATED):
        path = tmp_path / name
        with zipfile.ZipFile(path, "w", compression) as archive:
            if description:
                archive.writestr(DESCRIPTION, XML)
            for member, content in dict(members).items():
                archive.writestr(member, content)
        return path

    return write


def refusal(path, tmp_path, **options):
    """The message with which unpacking is refused; nothing is left of it, and opening alone refuses the same."""
    target = tmp_path / "target"
    with pytest.raises(ModelError) as error:
        unpack(path, target, **options)
    assert not target.exists()
    with pytest.raises(ModelError), open_archive(path, **options):
        pass
    assert str(path) in str(error.value)
    return str(error.value)


def changed(path, old, new, count=-1):
    """Replace bytes in a file."""
    path.write_bytes(path.read_bytes().replace(old, new, count))
    return path


def test_what_is_harmless_is_unpacked(pack, tmp_path):
    path = pack(
        {"resources/": b"", "resources/a.txt": b"a", "binaries/x86_64-linux/robot.so": bytes(100_000)}
    )
    folder = unpack(path, tmp_path / "new")
    found = {
        str(file.relative_to(folder)): file.stat().st_size for file in folder.rglob("*") if file.is_file()
    }
    assert found == {DESCRIPTION: len(XML), "resources/a.txt": 1, "binaries/x86_64-linux/robot.so": 100_000}
    (tmp_path / "empty").mkdir()
    assert unpack(path, tmp_path / "empty") == tmp_path / "empty"
    with open_archive(path) as archive:
        assert archive.read("resources/a.txt") == b"a"
        assert archive.size == len(XML) + 1 + 100_000
        assert "resources/" not in archive.names


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("/etc/passwd", "has an absolute path"),
        ("C:/x", "has an absolute path"),
        ("../x", "leads out of the archive"),
        ("a/../../x", "leads out of the archive"),
        ("a/..", "leads out of the archive"),
        ("a\\b", "has a backslash in its name"),
        ("..\\x", "has a backslash in its name"),
        ("ab:c", "has the character ':' in its name"),
        ("a/b?", "has the character '?' in its name"),
        ("a\nb", r"has the character '\n' in its name"),
        ("a//b", "has an empty part or '.'"),
        ("./a", "has an empty part or '.'"),
        ("a/con", "has a name that Windows keeps for devices"),
        ("AUX.txt", "has a name that Windows keeps for devices"),
        ("nul .x/a", "has a name that Windows keeps for devices"),
        ("lpt1", "has a name that Windows keeps for devices"),
        ("a. /b", "has a part that ends with a dot or a space"),
        ("a.", "has a part that ends with a dot or a space"),
        (256 * "a", "has a path that is too long"),
        ("/".join(201 * ["aaaaa"]), "has a path that is too long"),
    ],
)
def test_an_unsafe_name_is_refused(pack, tmp_path, name, words):
    assert words in refusal(pack({name: b"x"}), tmp_path)
    assert [file.name for file in tmp_path.rglob("*")] == ["robot.fmu"]


def test_a_name_with_a_zero_byte_is_refused(pack, tmp_path):
    path = changed(pack({"good.txt@evil": b"x"}), b"good.txt@evil", b"good.txt\0evil")
    assert r"member 'good.txt\x00evil' has the character '\x00' in its name" in refusal(path, tmp_path)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (stat.S_IFLNK, "is a symbolic link"),
        (stat.S_IFIFO, "is a special file"),
        (stat.S_IFCHR, "is a special file"),
        (stat.S_IFSOCK, "is a special file"),
        (stat.S_IFDIR, "is a special file"),  # under the name of a file
    ],
)
def test_links_and_special_files_are_refused(pack, tmp_path, kind, words):
    member = zipfile.ZipInfo("resources/link")
    member.external_attr = (kind | 0o777) << 16
    assert words in refusal(pack({member: b"/etc/passwd"}), tmp_path)


def test_a_link_of_windows_is_refused(pack, tmp_path):
    member = zipfile.ZipInfo("resources/link")
    member.external_attr = 0x400
    assert "is a symbolic link" in refusal(pack({member: b"x"}), tmp_path)


def test_too_many_entries_are_refused(pack, tmp_path):
    path = pack({f"resources/{k}": b"" for k in range(5_000)})
    assert "found 5,001 entries, expected at most 5,000" in refusal(path, tmp_path)


def test_a_huge_directory_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "robot.fmu"
    size = 5_000_000
    path.write_bytes(bytes(size) + struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 1, 1, size, 0, 0))
    assert "its directory has 5,000,000 bytes, expected at most 4,000,000" in refusal(path, tmp_path)


def test_too_much_content_is_refused_by_its_headers(pack, tmp_path):
    half = bytes(100_000_001)
    path = pack({"resources/a": half, "resources/b": half})
    assert path.stat().st_size < 1_000_000  # a bomb: small as long as it is packed
    assert "found 200 MB or more, expected at most 200 MB unpacked" in refusal(path, tmp_path)


def test_too_much_content_is_refused_while_it_is_counted(pack, tmp_path, monkeypatch):
    path = pack({"resources/a": bytes(1_000_000)})
    monkeypatch.setattr(safety, "UNPACKED", 900_000)
    monkeypatch.setattr(safety, "_check_directory", lambda infos: None)  # headers that lie
    assert "found 1 MB or more" in refusal(path, tmp_path)


def test_a_header_that_lies_about_the_size_is_refused(pack, tmp_path):
    size = 1_000_000
    path = changed(pack({"resources/a": bytes(size)}), struct.pack("<L", size), struct.pack("<L", 10))
    assert "found a damaged member 'resources/a'" in refusal(path, tmp_path)


def test_a_large_file_is_refused_unread(tmp_path):
    path = tmp_path / "robot.fmu"
    with path.open("wb") as file:
        file.truncate(300_000_000)  # takes no room on the disk
    assert "found 300 MB or more" in refusal(path, tmp_path)


def test_encrypted_members_are_refused(pack, tmp_path):
    path = pack({"a": b"x"}, compression=zipfile.ZIP_STORED)
    content = bytearray(path.read_bytes())
    for mark, offset in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        content[content.rindex(mark) + offset] |= 1
    path.write_bytes(content)
    assert "member 'a' is encrypted" in refusal(path, tmp_path)


@pytest.mark.parametrize(("method", "number"), [(zipfile.ZIP_BZIP2, 12), (zipfile.ZIP_LZMA, 14)])
def test_other_compressions_are_refused(pack, tmp_path, method, number):
    words = f"is compressed by method {number}, expected deflate (8) or none (0)"
    assert words in refusal(pack({"a": b"x"}, compression=method), tmp_path)


@pytest.mark.parametrize(
    ("first", "second"), [("a/B.txt", "A/b.txt"), ("straße", "STRASSE"), ("\u00e9", "e\u0301"), ("a/x", "A")]
)
def test_names_that_some_systems_confuse_are_refused(pack, tmp_path, first, second):
    message = refusal(pack({first: b"1", second: b"2"}), tmp_path)
    assert "differ only in case" in message or "as file and as folder" in message


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_a_member_that_is_there_twice_is_refused(pack, tmp_path):
    path = pack({"a": b"1"})
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("a", b"2")
    assert "found 'a' twice, expected each member once" in refusal(path, tmp_path)


def test_members_that_share_their_bytes_are_refused(pack, tmp_path):
    path = pack({"a": b"same", "b": b"same"}, compression=zipfile.ZIP_STORED)
    content = bytearray(path.read_bytes())
    first, second = content.index(b"PK\3\4", 1), content.rindex(b"PK\3\4")
    place = content.rindex(struct.pack("<L", second))  # in the directory
    content[place : place + 4] = struct.pack("<L", first)
    path.write_bytes(content)
    assert "overlaps another one" in refusal(path, tmp_path)


def test_an_archive_without_model_description_is_refused(pack, tmp_path):
    path = pack({"robot/modelDescription.xml": XML}, description=False)
    message = refusal(path, tmp_path)
    assert "found no modelDescription.xml in it, expected one at the top" in message
    assert "pack the content of the folder 'robot', not the folder" in message
    path = pack({"a": b""}, description=False)
    assert "check that it is the right file" in refusal(path, tmp_path)
    assert (unpack(path, tmp_path / "other", needs="a") / "a").is_file()


def test_what_is_no_archive_is_refused(tmp_path):
    path = tmp_path / "robot.fmu"
    path.write_bytes(b"PK, but no archive")
    assert "found a damaged directory (File is not a zip file)" in refusal(path, tmp_path)
    path.write_bytes(b"")
    assert "found an empty file, expected a zip archive" in refusal(path, tmp_path)
    path.unlink()
    path.mkdir()
    assert "found a folder of this name, expected a file" in refusal(path, tmp_path)


def test_a_file_that_is_not_there_gets_a_proposal(pack, tmp_path):
    pack({}, name="robots.fmu")
    message = refusal(tmp_path / "robot.fmu", tmp_path)
    assert "found no such file, expected an archive; did you mean 'robots.fmu'?" in message


def test_a_cut_archive_is_refused(pack, tmp_path):
    whole = pack({"a": random.Random(1).randbytes(2000)}).read_bytes()
    path = tmp_path / "cut.fmu"
    for end in range(1, len(whole), 97):
        path.write_bytes(whole[:end])
        assert "damaged" in refusal(path, tmp_path)


def test_a_damaged_member_is_refused(pack, tmp_path):
    path = pack({"a": b"0123456789"}, compression=zipfile.ZIP_STORED)
    assert "found a damaged member 'a' (Bad" in refusal(changed(path, b"0123456", b"0123457"), tmp_path)


def test_flipped_bytes_never_raise_anything_else(pack, tmp_path):
    """Whatever byte is changed: an archive is read as it was, or refused with our own message."""
    generator = random.Random(7)
    content = {"resources/a.txt": b"text " * 40, "binaries/x/y.so": generator.randbytes(30)}
    whole = pack(content).read_bytes()
    path, refused = tmp_path / "flipped.fmu", 0
    for place in range(len(whole)):
        flipped = bytearray(whole)
        flipped[place] ^= generator.randrange(1, 256)
        path.write_bytes(flipped)
        try:
            with open_archive(path) as archive:
                found = {archive.read(name) for name in archive.names}
            assert found == {XML, *content.values()}  # only a name, a date or a comment has changed
        except GantryTauError:
            refused += 1
            if place % 20 == 0:
                refusal(path, tmp_path)
    assert refused > len(whole) / 2


def test_only_an_empty_folder_is_unpacked_into(pack, tmp_path):
    path = pack({})
    (tmp_path / "target").mkdir()
    (tmp_path / "target" / "mine").write_text("keep")
    with pytest.raises(ModelError, match="found files in this folder, expected an empty one"):
        unpack(path, tmp_path / "target")
    assert (tmp_path / "target" / "mine").read_text() == "keep"
    with pytest.raises(ModelError, match=r"cannot be written \(No such file or directory\); name another"):
        unpack(path, tmp_path / "no" / "target")


def test_an_existing_folder_is_emptied_after_a_refusal(pack, tmp_path):
    path = changed(
        pack({"x/y/z": b"1", "a": b"0123456789"}, compression=zipfile.ZIP_STORED), b"0123", b"0124"
    )
    (tmp_path / "target").mkdir()
    with pytest.raises(ModelError, match="damaged member 'a'"):
        unpack(path, tmp_path / "target")
    assert list((tmp_path / "target").iterdir()) == []


def test_an_interruption_leaves_nothing(pack, tmp_path, monkeypatch):
    def interrupted(archive, count, chunk):
        raise KeyboardInterrupt

    monkeypatch.setattr(safety.Archive, "_counted", interrupted)
    with pytest.raises(KeyboardInterrupt):
        unpack(pack({}), tmp_path / "target")
    assert not (tmp_path / "target").exists()


def test_a_disk_that_is_full_is_told(pack, tmp_path, monkeypatch):
    def full(self, *arguments, **options):
        raise OSError(28, "No space left on device")

    path = pack({})
    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", full)
        with pytest.raises(ModelError, match=r"cannot be written \(No space left on device\); name another"):
            unpack(path, tmp_path / "target")
    assert not (tmp_path / "target").exists()


def test_a_member_that_is_not_there_or_too_long_is_refused(pack):
    with open_archive(pack({"a": bytes(1000)})) as archive:
        with pytest.raises(ModelError, match="there is no 'b' in it, expected one"):
            archive.read("b")
        with pytest.raises(ModelError, match="'a' has more than 999 bytes, expected no more"):
            archive.read("a", limit=999)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "found a document type (DTD)"),
        (b'<!DOCTYPE a SYSTEM "file:///etc/passwd"><a/>', "found a document type (DTD)"),
        ('<?xml version="1.0" encoding="UTF-16"?><!DOCTYPE a><a/>'.encode("utf-16"), "found a document type"),
        (b'<?xml version="1.0" encoding="UTF-7"?><a/>', "found the encoding UTF-7, expected UTF-8"),
        (b"<a>", "found no proper XML (no element found"),
        (b"<b:a/>", "found no proper XML (unbound prefix"),
        (b"<a>&b;</a>", "found no proper XML (undefined entity"),
        (b"<a>\xff</a>", "found no proper XML (not well-formed"),
        (b"", "found no proper XML (no element found"),
        (101 * b"<a>" + 101 * b"</a>", "found elements 101 deep, expected no more than 100"),
    ],
)
def test_xml_that_could_do_harm_is_refused(text, words):
    with pytest.raises(ModelError) as error:
        check_xml(text, "robot.fmu: 'x.xml'")
    assert str(error.value).startswith("robot.fmu: 'x.xml': ")
    assert words in str(error.value)


def test_laughs_are_not_counted(pack, tmp_path):
    """Ten entities of ten others each, nine deep, would be a billion words."""
    entities = "".join(f'<!ENTITY l{k + 1} "{10 * f"&l{k};"}">' for k in range(9))
    text = f'<!DOCTYPE a [<!ENTITY l0 "ha">{entities}]><a>&l9;</a>'.encode()
    path = pack({DESCRIPTION: text}, description=False)
    with (
        open_archive(path) as archive,
        pytest.raises(ModelError, match=r"document type \(DTD\), expected XML without"),
    ):
        archive.xml(DESCRIPTION)


def test_an_xml_file_that_is_too_large_is_not_parsed(pack, monkeypatch):
    monkeypatch.setattr(safety, "XML", 50)
    with open_archive(pack({})) as archive, pytest.raises(ModelError, match="has more than 50 bytes"):
        archive.xml(DESCRIPTION)


def test_an_archive_in_memory_is_not_needed(pack):
    """An archive with a text before it, as self-extracting ones have, is read as any other."""
    path = pack({"a": b"x"})
    path.write_bytes(b"#!/bin/sh\n" + path.read_bytes())
    with open_archive(path) as archive:
        assert zipfile.is_zipfile(BytesIO(path.read_bytes()))
        assert archive.read("a") == b"x"
