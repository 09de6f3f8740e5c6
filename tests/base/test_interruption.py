"""A Ctrl-C that comes where no exception can be taken is not lost."""

import signal
import subprocess
import sys

import pytest
from grasp_cosim.base.interruption import AT_ONCE

HEAD = """\
import ctypes, os, signal, sys, time, weakref
from grasp_cosim.base import interruption
from grasp_cosim.cli import frame

of_command = sys.modules["grasp_cosim.cli.entry"]


class Thing:
    pass


def interrupt(*_):
    os.kill(os.getpid(), signal.{number})
    for _ in range(1000):  # until the handler has run
        pass
    return 0


def in_a_weak_reference():
    thing = Thing()
    reference = weakref.ref(thing, interrupt)
    del thing


def in_a_finalizer():
    class Finalized:
        __del__ = interrupt

    Finalized()


def in_a_callback_from_c():
    compare = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(interrupt)
    numbers = (ctypes.c_int * 2)(2, 1)
    ctypes.CDLL(None).qsort(numbers, ctypes.c_size_t(2), ctypes.c_size_t(4), compare)


def in_an_fmu():
    with interruption.interruptible():
        in_a_callback_from_c()


def twice():
    in_a_weak_reference()
    time.sleep({pause})
    interrupt()
    time.sleep(20.0)


def work(arguments):
    {place}()
    for _ in range({rounds}):
        time.sleep(0.01)
    print("done")
    return 0


def main(arguments):
    try:
        return work(arguments)
    except KeyboardInterrupt:
        return frame.fail("interrupted", 130)


of_command.main = main
of_command.entry()
"""


def ended(place, number="SIGINT", rounds=1000):
    code = HEAD.format(place=place, number=number, rounds=rounds, pause=3.0 * AT_ONCE)
    command = [sys.executable, "-c", code]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=60, preexec_fn=default_handler
    )


def default_handler():
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [("SIGINT", 130), ("SIGTERM", 143)])
@pytest.mark.parametrize(
    "place", ["in_a_weak_reference", "in_a_finalizer", "in_a_callback_from_c", "in_an_fmu"]
)
def test_it_ends_the_command_all_the_same(place, number, code):
    done = ended(place, number)
    assert (done.returncode, done.stdout, done.stderr) == (code, "", "grasp-cosim: interrupted\n")


def test_where_the_work_is_done_by_then_the_code_still_tells_of_it():
    done = ended("in_a_weak_reference", rounds=0)
    assert (done.returncode, done.stdout, done.stderr) == (130, "done\n", "")


@pytest.mark.slow
def test_a_second_one_ends_the_process_at_once():
    done = ended("twice")
    assert (done.returncode, done.stdout) == (130, "")
