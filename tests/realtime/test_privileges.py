"""What is asked of the operating system: granted or refused in plain words, and put back."""

import ctypes
import errno
import gc
import os
import sys

import pytest
from grasp_cosim import Realtime
from grasp_cosim.realtime.pacer import privileges

linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has these")

ALL = Realtime(priority=20, cpu=0, lock_memory=True)


def refuses(code):
    def call(*_):
        raise OSError(code, os.strerror(code))

    return call


class System:
    """What an operating system that grants all of it was asked."""

    def __init__(self, monkeypatch):
        self.asked = []
        for name in ("sched_setscheduler", "sched_setaffinity"):
            monkeypatch.setattr(os, name, self._remember(name), raising=False)
        monkeypatch.setattr(os, "sched_getscheduler", lambda thread: 0, raising=False)
        monkeypatch.setattr(os, "sched_getparam", lambda thread: "parameter", raising=False)
        monkeypatch.setattr(os, "sched_getaffinity", lambda thread: {0, 1}, raising=False)
        self.code = 0
        monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: self)

    def _remember(self, name):
        return lambda thread, *arguments: self.asked.append((name, *arguments))

    def mlockall(self, flags):
        self.asked.append(("mlockall", flags))
        ctypes.set_errno(self.code)
        return -1 if self.code else 0

    def munlockall(self):
        self.asked.append(("munlockall",))
        return 0


@linux
def test_what_was_granted_is_put_back(monkeypatch):
    system = System(monkeypatch)
    with privileges(ALL) as found:
        assert found.granted == ["CPU 0", "memory locked", "SCHED_FIFO, priority 20"]
        assert found.refused == []
        given = [entry[0] for entry in system.asked]
        assert given == ["sched_setaffinity", "mlockall", "sched_setscheduler"]
        system.asked.clear()
    assert system.asked == [
        ("sched_setscheduler", 0, "parameter"), ("munlockall",), ("sched_setaffinity", {0, 1}),
    ]  # fmt: skip


@linux
def test_what_is_not_permitted_is_said_with_the_remedy(monkeypatch):
    system = System(monkeypatch)
    system.code = errno.ENOMEM
    monkeypatch.setattr(os, "sched_setscheduler", refuses(errno.EPERM))
    monkeypatch.setattr(os, "sched_setaffinity", refuses(errno.EINVAL))
    with privileges(ALL) as found:
        assert found.granted == []
    cpu, memory, priority = found.refused
    assert cpu == "CPU 0: Invalid argument; must be one of 0, 1"
    assert memory.startswith("memory locked: Cannot allocate memory; needs CAP_IPC_LOCK, or a")
    assert priority.startswith(
        "SCHED_FIFO, priority 20: Operation not permitted; needs CAP_SYS_NICE, or a limit"
    )
    assert system.asked == [("mlockall", 7)]


def test_a_system_that_has_none_of_it(monkeypatch):
    for name in ("sched_setscheduler", "sched_getscheduler", "sched_getaffinity"):
        monkeypatch.delattr(os, name, raising=False)
    monkeypatch.setattr(sys, "platform", "darwin")
    with privileges(ALL) as found:
        assert found.granted == []
    assert found.refused == [
        f"{name}: not possible on this operating system"
        for name in ("CPU 0", "memory locked", "SCHED_FIFO, priority 20")
    ]


@pytest.mark.parametrize("collecting", [True, False])
def test_no_garbage_is_collected_on_the_way(collecting):
    before = gc.isenabled()
    (gc.enable if collecting else gc.disable)()
    try:
        with privileges(Realtime()) as found:
            assert not gc.isenabled()
            assert gc.get_freeze_count() > 0
        assert (gc.isenabled(), gc.get_freeze_count()) == (collecting, 0)
        assert (found.granted, found.refused) == ([], [])
    finally:
        (gc.enable if before else gc.disable)()


@pytest.mark.parametrize(
    ("runtime", "sleeps", "said"), [("950000", False, 1), ("950000", True, 0), ("-1", False, 0)]
)
def test_a_priority_that_the_kernel_breaks_off_is_said(
    monkeypatch, tmp_path, runtime, sleeps, said
):
    """Where there is no time to sleep, and Linux limits such threads to a share of the time."""
    monkeypatch.setattr("grasp_cosim.realtime.pacer.THROTTLE", tmp_path / "runtime")
    (tmp_path / "runtime").write_text(runtime)
    System(monkeypatch)
    with privileges(Realtime(priority=20), sleeps) as found:
        assert [line[:23] for line in found.refused] == ["SCHED_FIFO all the time"] * said


@linux
def test_a_cpu_of_this_machine_is_granted():
    before = os.sched_getaffinity(0)
    with privileges(Realtime(cpu=min(before))) as found:
        assert os.sched_getaffinity(0) == {min(before)}
    assert found.granted == [f"CPU {min(before)}"]
    assert os.sched_getaffinity(0) == before
