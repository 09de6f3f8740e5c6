"""The built-in system: its FMUs are in the user's cache, however many ask for it at once."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from grasp_cosim import grasp_system
from grasp_fmus import build as builds
from grasp_fmus.shipped import SHIPPED
from support.marks import skip_without_pythonfmu

EIGHT_THREADS = """
from concurrent.futures import ThreadPoolExecutor
from grasp_cosim import grasp_system

with ThreadPoolExecutor(8) as pool:
    made = list(pool.map(lambda _: grasp_system(native=False), range(8)))
print(len({c.fmu.parent for system in made for c in system.components}))
"""


@pytest.fixture
def empty(tmp_path, monkeypatch):
    """An empty current folder, and an empty cache beside it."""
    skip_without_pythonfmu()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    return here


@pytest.mark.slow
def test_the_first_build_may_be_asked_for_by_many_threads_and_processes(empty):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", EIGHT_THREADS]
    processes = [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    assert [process.communicate()[0] for process in processes] == ["1\n", "1\n"]
    assert len(list(Path(os.environ["XDG_CACHE_HOME"], "grasp-cosim/fmus").iterdir())) == 1
    assert list(empty.iterdir()) == []


def test_where_nothing_can_be_kept_one_line_says_so_and_threads_share_it(
    empty, monkeypatch, caplog
):
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    monkeypatch.setattr(builds, "_until_the_end", {})
    of_the_grasp = {name: shipped for name, shipped in SHIPPED.items() if not shipped.size}
    monkeypatch.setattr(builds, "SHIPPED", of_the_grasp)
    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(lambda _: grasp_system(native=False), range(8)))
    assert len({c.fmu.parent for system in made for c in system.components}) == 1
    assert caplog.messages == [
        "/dev/null/grasp-cosim: cannot be written to, so each process builds the FMUs; "
        "XDG_CACHE_HOME names another"
    ]
    assert list(empty.iterdir()) == []
