"""A file that cannot be written is named as it was asked for, not as it is called meanwhile."""

import errno
import os
from pathlib import Path

import pytest
from grasp_cosim.base.files import in_one_piece, write_text
from recording.rows import full_disk


def test_a_full_disk_names_the_target(tmp_path: Path) -> None:
    path = tmp_path / "wanted.txt"
    with full_disk(10), pytest.raises(OSError, match="too large") as caught:
        write_text(path, "x" * 1000)
    assert caught.value.filename == str(path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", [None, "part", "path"])
def test_an_error_that_names_the_temporary_file(tmp_path: Path, name: str | None) -> None:
    path = tmp_path / "wanted.txt"
    with pytest.raises(OSError, match="No space") as caught, in_one_piece(path) as part:
        raise _no_space({None: None, "part": str(part), "path": part}[name])
    assert caught.value.filename == str(path)


def _no_space(name: object) -> OSError:
    error = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    error.filename = name
    return error


def test_another_file_keeps_its_name(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as caught, in_one_piece(tmp_path / "wanted.txt"):
        (tmp_path / "other.txt").read_text()
    assert caught.value.filename == str(tmp_path / "other.txt")
