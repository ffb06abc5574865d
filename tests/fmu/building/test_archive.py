"""Archives: where binaries stand, the same bytes from the same content, and all or nothing."""

import os
import struct
import zipfile

import pytest

from gantrytau import ModelError
from gantrytau_fmu.building import archive
from gantrytau_fmu.building.archive import binary_members, binary_path, check_target, universal, write_archive
from gantrytau_fmu.building.platforms import PLATFORMS

MEMBERS = {
    "sources/fmu.c": b"int x;\n" * 1000,
    "binaries/x86_64-linux/robot.so": bytes(range(256)),
    "modelDescription.xml": b"<fmiModelDescription/>",
}


def test_binaries_stand_where_the_standard_says():
    names = {name: binary_path(platform, "3.0", "robot") for name, platform in PLATFORMS.items()}
    assert names["x86_64-windows"] == "binaries/x86_64-windows/robot.dll"
    assert names["aarch64-darwin"] == "binaries/aarch64-darwin/robot.dylib"
    names = {name: binary_path(platform, "2.0", "robot") for name, platform in PLATFORMS.items()}
    assert names["x86_64-linux"] == "binaries/linux64/robot.so"
    assert names["x86_64-windows"] == "binaries/win64/robot.dll"
    assert names["x86_64-darwin"] == "binaries/darwin64/robot.dylib"
    assert names["aarch64-linux"] == "binaries/aarch64-linux/robot.so"


def test_fmi_3_has_one_file_for_each_platform():
    libraries = {platform: name.encode() for name, platform in PLATFORMS.items()}
    members = binary_members(libraries, "3.0", "robot")
    assert members == {binary_path(p, "3.0", "robot"): p.name.encode() for p in PLATFORMS.values()}


def test_fmi_2_for_arm64_stands_in_the_old_folders_too():
    arm = PLATFORMS["aarch64-linux"]
    assert binary_members({arm: b"arm"}, "2.0", "robot") == {
        "binaries/aarch64-linux/robot.so": b"arm",
        "binaries/linux64/robot.so": b"arm",
    }
    both = {PLATFORMS["x86_64-linux"]: b"intel", arm: b"arm"}
    assert binary_members(both, "2.0", "robot")["binaries/linux64/robot.so"] == b"intel"
    both = {PLATFORMS["x86_64-darwin"]: b"intel", PLATFORMS["aarch64-darwin"]: b"arm"}
    members = binary_members(both, "2.0", "robot")
    assert members["binaries/aarch64-darwin/robot.dylib"] == b"arm"
    assert members["binaries/darwin64/robot.dylib"] == universal(b"intel", b"arm")


def test_a_universal_file_holds_both_at_pages():
    intel, arm = b"i" * 20000, b"a" * 5
    data = universal(intel, arm)
    assert struct.unpack_from(">2I", data) == (0xCAFEBABE, 2)
    for entry, (processor, content) in enumerate([(0x01000007, intel), (0x0100000C, arm)]):
        kind, _, offset, size, align = struct.unpack_from(">5I", data, 8 + 20 * entry)
        assert (kind, offset % 2**align) == (processor, 0)
        assert data[offset : offset + size] == content


def test_the_content_comes_back_with_the_description_first(tmp_path):
    path = write_archive(tmp_path / "robot.fmu", MEMBERS)
    with zipfile.ZipFile(path) as found:
        assert found.testzip() is None
        assert found.namelist() == ["modelDescription.xml", *sorted(MEMBERS)[::2]]
        assert {name: found.read(name) for name in found.namelist()} == MEMBERS
        assert {entry.compress_type for entry in found.infolist()} == {zipfile.ZIP_DEFLATED}
    assert path.stat().st_size < 1000  # of 7000 bytes
    assert list(tmp_path.iterdir()) == [path]


def test_the_same_members_give_the_same_bytes(tmp_path):
    backwards = dict(reversed(MEMBERS.items()))
    first, second = (
        write_archive(tmp_path / "a.fmu", MEMBERS),
        write_archive(str(tmp_path / "b.fmu"), backwards),
    )
    assert first.read_bytes() == second.read_bytes()


def test_other_archives_have_their_own_suffix_and_first_member(tmp_path):
    members = {"resources/robot.fmu": b"", "SystemStructure.ssd": b"<ssd/>"}
    path = write_archive(tmp_path / "cell.ssp", members, suffix=".ssp", first="SystemStructure.ssd")
    assert zipfile.ZipFile(path).namelist() == ["SystemStructure.ssd", "resources/robot.fmu"]


def test_a_file_is_replaced_unless_it_must_not(tmp_path):
    path = tmp_path / "robot.fmu"
    path.write_text("old")
    with pytest.raises(ModelError, match=r"robot\.fmu: found a file, expected none; .*overwrite=True"):
        write_archive(path, MEMBERS, overwrite=False)
    assert path.read_text() == "old"
    write_archive(path, MEMBERS)
    assert zipfile.is_zipfile(path)
    assert write_archive(tmp_path / "new.fmu", MEMBERS, overwrite=False).exists()


def test_wrong_paths_are_refused(tmp_path):
    with pytest.raises(ModelError, match=r"robot\.zip: found the suffix '\.zip', expected '\.fmu'; call it"):
        write_archive(tmp_path / "robot.zip", MEMBERS)
    with pytest.raises(ModelError, match=r"found the suffix '', expected '\.fmu'"):
        write_archive(tmp_path / "robot", MEMBERS)
    (tmp_path / "folder.fmu").mkdir()
    with pytest.raises(ModelError, match=r"folder\.fmu: found a folder, expected a file that ends in"):
        write_archive(tmp_path / "folder.fmu", MEMBERS)
    with pytest.raises(ModelError, match="does not exist; create it"):
        write_archive(tmp_path / "nowhere" / "robot.fmu", MEMBERS)
    (tmp_path / "file").touch()
    with pytest.raises(ModelError, match="does not exist; create it"):
        write_archive(tmp_path / "file" / "robot.fmu", MEMBERS)
    with pytest.raises(ModelError, match=r"cannot be written .*name another one"):
        write_archive(tmp_path / ("x" * 300 + ".fmu"), MEMBERS)
    with pytest.raises(ModelError, match=r"cannot be written .*name another one"):
        write_archive(tmp_path / "nul\0.fmu", MEMBERS)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder.fmu"]


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="the superuser may write everywhere")
def test_a_folder_without_permission_is_refused(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(ModelError, match=r"cannot be written .*permission"):
        write_archive(tmp_path / "robot.fmu", MEMBERS)


@pytest.mark.parametrize(
    "error", [PermissionError(13, "Permission denied"), OSError(28, "No space left on device")]
)
def test_a_failure_while_writing_leaves_what_was_there(tmp_path, monkeypatch, error):
    path = tmp_path / "robot.fmu"
    path.write_text("old")
    monkeypatch.setattr(archive, "_write", failing(error))
    with pytest.raises(
        ModelError, match=rf"robot\.fmu: cannot be written \({error.strerror}\), expected a folder"
    ):
        write_archive(path, MEMBERS)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_an_interruption_leaves_what_was_there(tmp_path, monkeypatch):
    monkeypatch.setattr(archive, "_write", failing(KeyboardInterrupt()))
    with pytest.raises(KeyboardInterrupt):
        write_archive(tmp_path / "robot.fmu", MEMBERS)
    assert list(tmp_path.iterdir()) == []


def test_a_path_can_be_checked_before_the_work(tmp_path):
    path = tmp_path / "robot.fmu"
    assert check_target(str(path)) == path
    assert list(tmp_path.iterdir()) == []
    path.write_text("old")
    assert check_target(path) == path
    assert path.read_text() == "old"
    assert check_target(tmp_path / "cell.ssp", ".ssp").suffix == ".ssp"
    with pytest.raises(ModelError, match="expected none"):
        check_target(path, overwrite=False)
    with pytest.raises(ModelError, match="does not exist; create it"):
        check_target(tmp_path / "nowhere" / "robot.fmu")


def failing(error: BaseException):
    """A writer that gets halfway."""

    def write(path, members, first):
        path.write_bytes(b"PK\3\4 half of it")
        raise error

    return write
