"""A file is whole or not there; links, devices and pipes stay what they are."""

import errno
import os
import stat
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread

import pytest
from grasp_cosim.base.one_piece import in_one_piece, is_stream
from recording.rows import full_disk

needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root makes devices")


def write(path, text):
    with in_one_piece(path) as part:
        part.write_text(text)


def test_a_full_disk_names_the_target(tmp_path):
    path = tmp_path / "wanted.txt"
    with full_disk(10), pytest.raises(OSError, match="too large") as caught:
        write(path, "x" * 1000)
    assert caught.value.filename == str(path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", [lambda part: None, str, lambda part: part])
def test_an_error_that_names_the_temporary_file(tmp_path, name):
    path = tmp_path / "wanted.txt"
    with pytest.raises(OSError, match="No space") as caught, in_one_piece(path) as part:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), name(part))
    assert caught.value.filename == str(path)


def test_another_file_keeps_its_name(tmp_path):
    with pytest.raises(FileNotFoundError) as caught, in_one_piece(tmp_path / "wanted.txt"):
        (tmp_path / "other.txt").read_text()
    assert caught.value.filename == str(tmp_path / "other.txt")


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(IsADirectoryError, match="must be the name of a file"):
        write(tmp_path, "")


@pytest.mark.parametrize("there", [True, False])
def test_a_link_stays_and_what_it_names_is_replaced(tmp_path, there):
    link, file = tmp_path / "link", tmp_path / "folder" / "file"
    link.symlink_to(Path("folder") / "file")
    if there:
        file.parent.mkdir()
        file.write_text("before")
    write(link, "after")
    assert link.is_symlink()
    assert file.read_text() == "after"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder", "link"]
    assert [p.name for p in file.parent.iterdir()] == ["file"]


@pytest.mark.skipif(not os.access("/dev/shm", os.W_OK), reason="there is no folder in memory")
def test_a_file_in_memory_is_replaced():
    with TemporaryDirectory(dir="/dev/shm") as folder:
        file = Path(folder, "file")
        write(file, "before")
        write(file, "after")
        assert file.read_text() == "after"
        assert not is_stream(file)


def test_whoever_reads_a_pipe_gets_what_is_written(tmp_path):
    pipe, found = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = Thread(target=lambda: found.append(pipe.read_bytes()), daemon=True)
    reader.start()
    (tmp_path / "link").symlink_to("pipe")
    write(tmp_path / "link", "text")
    reader.join(10.0)
    assert found == [b"text"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["link", "pipe"]


@needs_root
def test_a_device_stays_one(tmp_path):
    null = tmp_path / "null"
    os.mknod(null, stat.S_IFCHR | 0o666, os.makedev(1, 3))
    write(null, "text")
    assert stat.S_ISCHR(null.stat().st_mode)
    assert list(tmp_path.iterdir()) == [null]


def test_what_is_written_into_stdout_comes_after_what_was_there(tmp_path):
    out = tmp_path / "out"
    with out.open("w") as file:
        file.write("before ")
        file.flush()
        write(Path(f"/dev/fd/{file.fileno()}"), "after")
    assert out.read_text() == "before after"


def test_files_folders_and_what_is_not_there_are_no_streams(tmp_path):
    (tmp_path / "file").touch()
    for path in (tmp_path, tmp_path / "file", tmp_path / "none", Path("/dev")):
        assert not is_stream(path)
    assert is_stream(Path("/dev/null"))
