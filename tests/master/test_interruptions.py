"""Ctrl-C ends what is going on, and says so: no run that was cut comes back as a result."""

import os
import signal
from dataclasses import replace

import pytest
from fmi.test_instances import alone
from grasp_cosim import RunInterruptedError, compare, metric, qualify, simulate, sweep
from support.marks import engines
from support.native_fmus import needs_gcc
from support.native_systems import driven

pytestmark = [needs_gcc, pytest.mark.usefixtures("ctrl_c")]


@pytest.fixture
def system(tmp_path):
    """One step of it sends Ctrl-C to this process, far from its end."""
    part = alone(tmp_path, "2.0", "none", interrupt_at=0.055, interrupted=os.getpid())
    return replace(part, step_ns=10_000_000, stop_ns=10**6 * 10**9)


@metric("last")
def last(run):
    """Any number."""
    return run["part.x"][-1]


@engines
def test_in_a_loop_of_runs_it_ends_the_loop_and_keeps_what_was_recorded(system, engine):
    done = []
    with pytest.raises(RunInterruptedError) as interrupted:
        done.extend(simulate(system, engine=engine) for _ in range(3))
    assert done == []
    result = interrupted.value.result
    assert 6 < len(result.time) < 10**8
    assert not result.complete
    assert result["part.x"] == pytest.approx(2.0 * result.time, rel=1e-9)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_where_the_run_is_done_or_fails_by_then_it_is_not_lost(tmp_path):
    for more in ({}, {"error_at": 0.95}):
        part = alone(tmp_path, "2.0", "none", interrupt_at=0.85, interrupted=os.getpid(), **more)
        with pytest.raises(RunInterruptedError) as interrupted:
            simulate(part, engine="python")
        assert interrupted.value.result.complete is not more
        assert len(interrupted.value.result.time) >= 10


@pytest.mark.slow
def test_studies_of_several_runs_end_too(system, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        sweep(system, [{"part.gain": 1.0}, {"part.gain": 2.0}], metrics=[last], workers=1)
    file = driven(tmp_path, "time\n0\n", step=0.01)
    given = f"values = {{ interrupt_at = 0.055, interrupted = {os.getpid()}, "
    text = file.read_text().replace("values = { ", given).replace("stop = 1.0", "stop = 1e6")
    file.write_text(text)
    with pytest.raises(KeyboardInterrupt):
        compare(file, file)
    with pytest.raises(KeyboardInterrupt):
        qualify(system, "part", system.components[0].fmu)
