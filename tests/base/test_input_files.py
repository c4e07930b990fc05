"""Files that somebody gave: regular, of bounded size, unpacked no larger, with plain values."""

import os
import socket
import threading
import zipfile

import numpy as np
import pytest
import scipy.io

import robustpolish as rp
from robustpolish.base.input_files import (
    FileSpec,
    check_tree,
    content,
    file_size,
    members,
    open_checked,
    text,
)
from robustpolish.errors import InvalidInputError

WANTED = FileSpec("path", "a file", "Check the path.", 100)
READERS = {
    "load": (rp.load, ".json"),
    "load a model": (rp.load, ".toml"),
    "Design.load": (rp.results.Design.load, ".json"),
    "Diagnosis.load": (rp.results.Diagnosis.load, ".json"),
    "SampledDesign.load": (rp.results.SampledDesign.load, ".json"),
    "GeneralizedPlant.load": (rp.GeneralizedPlant.load, ".json"),
    "from_toml": (rp.MechanicalModel.from_toml, ".toml"),
    "task": (rp.read_design_task, ".toml"),
    **{f"record{suffix}": (rp.read_measurement, suffix)
       for suffix in (".csv", ".lvm", ".mat", ".h5", ".npz", ".wav", ".tdms", ".uff")},
    "response.csv": (rp.read_frequency_response, ".csv"),
    "response.uff": (rp.read_frequency_response, ".uff"),
    "mould.csv": (rp.polishing.Mould.from_csv, ".csv"),
    "mould.stl": (
        lambda path, **more: rp.polishing.Mould.from_stl(path, unit="mm", **more),
        ".stl",
    ),
    "path": (lambda path, **more: rp.polishing.ToolPath.from_csv(path, speed=0.1, **more), ".csv"),
}  # fmt: skip


@pytest.fixture(params=READERS)
def reader(request):
    return READERS[request.param]


def refused(read, *arguments, match, **more):
    """Whether a call ends in our error, in a thread that may hang."""
    found = []

    def call():
        try:
            found.append(read(*arguments, **more))
        except BaseException as error:
            found.append(error)

    thread = threading.Thread(target=call, daemon=True)
    thread.start()
    thread.join(20)
    assert found, "it blocks"
    assert isinstance(found[0], rp.InvalidInputError), found[0]
    assert match in str(found[0])


def test_no_reader_opens_what_is_no_regular_file(reader, tmp_path):
    read, suffix = reader
    pipe, folder, zero = (tmp_path / f"{name}{suffix}" for name in ("pipe", "folder", "zero"))
    os.mkfifo(pipe)
    folder.mkdir()
    zero.symlink_to("/dev/zero")
    refused(read, pipe, match="a pipe")
    refused(read, folder, match="a folder")
    refused(read, zero, match="a device")
    refused(read, tmp_path / f"none{suffix}", match="o such file")
    refused(read, tmp_path / f"{'a' * 300}{suffix}", match="File name too long")
    refused(read, tmp_path / f"a\0b{suffix}", match="embedded null")


def test_every_reader_has_a_limit_that_can_be_raised(reader, tmp_path):
    read, suffix = reader
    path = tmp_path / f"large{suffix}"
    path.write_bytes(b"a,b\n1,2\n" * 100)
    if read is rp.read_design_task:
        return  # whoever trusts a larger file reads the model first
    refused(read, path, max_bytes=100, match="at most 100 bytes. If you trust the file, raise max_")
    refused(read, path, max_bytes=-1, match="max_bytes")


def test_nothing_is_no_path(reader):
    for nothing in (None, 3, b"a.json"):
        with pytest.raises(rp.InvalidInputError):
            reader[0](nothing)


def test_sockets_and_files_without_permission(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # names of sockets are short
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("socket")
        with pytest.raises(rp.InvalidInputError, match="a socket"):
            content("socket", WANTED)
    path = tmp_path / "secret"
    path.write_bytes(b"a")
    path.chmod(0)
    if not os.access(path, os.R_OK):
        with pytest.raises(rp.InvalidInputError, match="Permission denied"):
            content(path, WANTED)


def test_what_fits_is_read(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(b"\xef\xbb\xbf" + "µ".encode())
    assert file_size(path, WANTED) == 5
    assert text(path, WANTED, "utf-8-sig") == "µ"
    with open_checked(path, WANTED) as file:
        assert not os.get_blocking(file.fileno()) or os.name == "nt"
    path.write_bytes(b"\xff")
    with pytest.raises(rp.InvalidInputError, match="not text in UTF-8"):
        text(path, WANTED)
    path.write_bytes(bytes(101))
    with pytest.raises(rp.InvalidInputError, match="of 101 bytes"):
        content(path, WANTED)
    assert len(content(path, WANTED.limited(101))) == 101


def test_a_file_that_grows_while_it_is_read_is_cut_off():
    wanted = FileSpec("path", "a file", "Check it.", 10)
    with pytest.raises(rp.InvalidInputError, match="at most 10 bytes"):
        content("/proc/self/status", wanted)  # it says that it has no bytes


def test_the_size_that_counts_is_the_unpacked_one(tmp_path):
    values = np.zeros(100_000)
    np.savez_compressed(tmp_path / "a.npz", t=values)
    scipy.io.savemat(tmp_path / "a.mat", {"t": values}, do_compression=True)
    for name in ("a.npz", "a.mat"):
        assert (tmp_path / name).stat().st_size < 10_000
        with pytest.raises(rp.InvalidInputError, match=f"{name}, unpacked,"):
            rp.read_measurement(tmp_path / name, max_bytes=100_000)


WANTED_ARCHIVE = FileSpec("path", "a file", "Check the path.", 10_000)


def found(path, wanted=WANTED_ARCHIVE):
    with open_checked(path, wanted) as file:
        return [info.filename for info in members(file, path, wanted)]


def test_members_are_listed_up_to_the_limit(tmp_path):
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a", bytes(6000))
        archive.writestr("b", bytes(4000))
    assert found(path) == ["a", "b"]
    with pytest.raises(rp.InvalidInputError, match="unpacked, of 10,000 bytes"):
        found(path, WANTED_ARCHIVE.limited(9_999))


def test_too_many_members_are_refused(tmp_path):
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for i in range(10_001):
            archive.writestr(str(i), b"")
    with pytest.raises(rp.InvalidInputError, match="10001 members"):
        found(path, WANTED_ARCHIVE.limited(10_000_000))


def test_an_array_that_claims_more_than_it_has_reserves_nothing(tmp_path):
    np.save(tmp_path / "a.npy", np.arange(10.0))
    claim = (tmp_path / "a.npy").read_bytes().replace(b"(10,)", b"(99999999999,)", 1)
    claim = claim.replace(b"         \n", b"\n", 1)  # the head keeps its length
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("a.npy", claim)
    with pytest.raises(rp.InvalidInputError, match="shorter than it says"):
        rp.read_measurement(tmp_path / "a.npz")


def nested(depth):
    tree = [1]
    for _ in range(depth):
        tree = [tree]
    return tree


@pytest.mark.parametrize(
    ("tree", "key", "message"),
    [
        ({"a": [1, 10**400]}, ("a", 1), "an integer of 401 digits"),
        ({"a": -(10**5000)}, ("a",), "an integer of 5001 digits"),
        ({"a": {"b": "\ud800"}}, ("a", "b"), "half a character"),
        ({"\ud800": 1}, (), "half a character"),
        ({"a": nested(5000)}, ("a", 0, 0), "tables in more than 50 tables"),
    ],
)
def test_what_nobody_means_is_refused(tree, key, message):
    with pytest.raises(InvalidInputError, match=message) as found:
        check_tree(tree, "a.json")
    assert found.value.key == key
    assert str(found.value).startswith("a.json: ")
