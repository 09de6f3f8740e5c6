"""Temporary folders: gone with their process, swept after a kill, nobody else's touched."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from grasp_cosim.base.scratch import PREFIX, ScratchFolder, sweep

KEEPS = "import sys; from grasp_cosim.base.scratch import ScratchFolder; a = ScratchFolder(); "
FILL = "open(a.name + '/library.so', 'w').close(); print(a.name, flush=True); "


@pytest.fixture
def folder(unpack_in):
    """The folder for temporary ones."""
    return unpack_in("tmp")


def ended(folder, how):
    """The folder of a process that ended in some way."""
    done = subprocess.run(
        [sys.executable, "-c", KEEPS + FILL + how],
        env={**os.environ, "TMPDIR": str(folder)},
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    return Path(done.stdout.strip())


def test_it_is_there_until_its_end(folder):
    with ScratchFolder() as scratch:
        (Path(scratch.name) / "sub").mkdir()
        sweep.cache_clear()
        sweep(str(folder))
        assert (Path(scratch.name) / "sub").exists()
    assert not list(folder.iterdir())
    scratch.cleanup()


@pytest.mark.parametrize("how", ["", "sys.exit(3)", "raise ValueError('on purpose')"])
def test_a_process_takes_it_with_it(folder, how):
    assert not ended(folder, how).exists()


def test_after_a_kill_the_next_process_removes_it(folder):
    left = ended(folder, "import os; os.kill(os.getpid(), 9)")
    assert (left / "library.so").exists()
    ended(folder, "")
    assert not left.exists()


def test_a_fork_leaves_that_of_its_parent(folder):
    how = "import os, pathlib; child = os.fork(); child or sys.exit(); os.wait(); "
    left = ended(folder, how + "print(pathlib.Path(a.name, 'library.so').exists())")
    assert str(left).endswith("True")


def test_what_is_not_known_to_be_left_stays(folder):
    theirs = folder / "other"
    theirs.mkdir()
    link = folder / f"{PREFIX}link"
    link.symlink_to(theirs)
    (theirs / "file").touch()
    (folder / f"{PREFIX}file").touch()
    sweep.cache_clear()
    sweep(str(folder))
    assert (theirs / "file").exists()
    assert (folder / f"{PREFIX}file").exists()
    assert link.is_symlink()
    sweep.cache_clear()
    sweep(str(folder / "missing"))


@pytest.mark.parametrize("theirs", ["grasp_scratch_", "grasp_cosim_scratch_3_"])
def test_those_of_a_version_that_locks_otherwise_stay(folder, theirs):
    """And it leaves ours: it takes what begins as its own do."""
    assert not PREFIX.startswith(theirs)
    other = folder / f"{theirs}0123456789abcdef"
    other.mkdir()
    sweep.cache_clear()
    sweep(str(folder))
    assert other.exists()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives folders away")
def test_those_of_others_stay(folder):
    theirs = Path(tempfile.mkdtemp(prefix=PREFIX, dir=folder))
    os.chown(theirs, 12345, 12345)
    sweep.cache_clear()
    sweep(str(folder))
    assert theirs.exists()
