"""A process with too many open files: it says so, and calls nothing damaged."""

import os
from contextlib import contextmanager

import pytest
from grasp_cosim import InputError
from grasp_cosim.fmi.load import load
from grasp_cosim.interface.read import describe
from grasp_cosim.recording.signals import read_log
from grasp_cosim.system.parts import Component
from support.native_fmus import build, needs_gcc, starts

resource = pytest.importorskip("resource", reason="NO limit of open files")
REASON = r"cannot be read: this process has too many files open; `ulimit -n` permits more$"


@contextmanager
def open_files(free=0):
    """No more files can be opened than so many."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    lowest = [os.open(os.devnull, os.O_RDONLY) for _ in range(free + 1)]
    for descriptor in lowest:
        os.close(descriptor)
    resource.setrlimit(resource.RLIMIT_NOFILE, (lowest[free], before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


@needs_gcc
def test_an_fmu_is_not_damaged_by_them(tmp_path):
    fmu = build(tmp_path)
    with open_files(), pytest.raises(InputError, match=f"^{fmu}: {REASON}"):
        describe(fmu)
    describe(fmu)
    component = Component("part", fmu, starts("2.0"))
    component.interface  # noqa: B018 - which is read by now
    load(component).close()
    with open_files(1), pytest.raises(InputError, match=f"^part: {fmu} {REASON}"):
        load(component)


def test_nor_is_a_recording(tmp_path):
    log = tmp_path / "log.arrow"
    pyarrow = pytest.importorskip("pyarrow")
    table = pyarrow.table({"time": [0.0, 1.0], "x": [1.0, 2.0]})
    with pyarrow.OSFile(str(log), "wb") as sink, pyarrow.ipc.new_file(sink, table.schema) as file:
        file.write_table(table)
    with open_files(), pytest.raises(InputError, match=REASON):
        read_log(log)
