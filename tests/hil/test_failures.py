"""Whatever fails, the outputs of a bench are safe within its watchdog and one step.

A real bench in C, whose "DAC" is observed, and a host, each a process of its own; by the own clock
of the bench and in lockstep. Times are those that were noted, on one clock: what the machine held
up is seen as a gap between two of the bench's steps, and allowed for.
"""

import shutil
import signal
import time

import numpy as np
import pytest
from support import marks
from support.observed.bench import (
    PERIOD,
    WATCHDOG,
    Bench,
    build,
    end,
    go_on,
    running,
    start_host,
    stop,
    wait_until,
)

pytestmark = pytest.mark.skipif(not shutil.which("gcc"), reason="NO gcc: nothing to compile with")

DRAWS = marks.part(20)
"""Moments of each failure."""

SCHEDULING = 0.02 if marks.exploring() else 0.2
"""s that a process may be late to be woken: little in a campaign, much beside other tests."""

CLOCKS = {"own clock": PERIOD, "lockstep": None}


@pytest.fixture(scope="session")
def program(made_once):
    return made_once("observed bench", build) / "bench"


def commanded(entries):
    """Those of the entries that are not safe."""
    return entries[(entries["first"] != 0.0) | (entries["second"] != 0.0)]


def safe_in_time(dac, moment_ns, allowed=WATCHDOG + PERIOD):
    """The outputs are safe, were so within the watchdog and one step, and stay so."""
    wait_until(dac.is_safe)
    time.sleep(4 * WATCHDOG)
    assert dac.is_safe()
    entries = dac.entries()
    commands = commanded(entries)
    after = entries[entries["ns"] > commands["ns"][-1]]
    assert len(after) > 0
    held_up = max(0.0, longest_gap_of_commands(commands, moment_ns) - PERIOD)
    first_safe = (int(after["ns"][0]) - moment_ns) / 1e9
    assert first_safe <= allowed + held_up + SCHEDULING, (first_safe, held_up)


def longest_gap_of_commands(commands, moment_ns):
    times = commands["ns"][commands["ns"] > moment_ns - 20_000_000]
    return float(np.diff(times).max()) / 1e9 if len(times) > 1 else 0.0


def host_killed(bench, host):
    host.kill()


def host_stopped(bench, host):
    stop(host)


def requests_cut(bench, host):
    host.send_signal(signal.SIGUSR1)


def answers_cut(bench, host):
    host.send_signal(signal.SIGUSR2)


def bench_killed(bench, host):
    bench.process.kill()


def bench_stopped(bench, host):
    stop(bench.process)


def bench_terminated(bench, host):
    bench.process.terminate()


FAILURES = (
    host_killed, host_stopped, requests_cut, answers_cut, bench_killed, bench_stopped,
    bench_terminated,
)  # fmt: skip


def drawn(seed):
    """Some time in which the loop goes on."""
    time.sleep(float(np.random.default_rng(seed).uniform(0.0, 0.1)))
    return time.monotonic_ns()


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("failure", FAILURES)
@pytest.mark.slow
@pytest.mark.campaign
def test_outputs_are_safe_after_a_failure(program, tmp_path, failure, clock):
    for seed in range(DRAWS):
        with running(program, tmp_path, CLOCKS[clock]) as (bench, host, dac):
            moment = drawn(seed)
            failure(bench, host)
            safe_in_time(dac, moment)


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.slow
def test_a_host_that_goes_on_after_a_stop(program, tmp_path, clock):
    """By its own clock the bench has tripped, until the next session; in lockstep it goes on."""
    with running(program, tmp_path, CLOCKS[clock]) as (_, host, dac):
        stop(host)
        wait_until(dac.is_safe)
        time.sleep(2 * WATCHDOG)
        before = len(commanded(dac.entries()))
        go_on(host)
        time.sleep(2 * WATCHDOG)
        assert (len(commanded(dac.entries())) > before) == (clock == "lockstep")


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.slow
def test_a_bench_that_goes_on_after_a_stop_does_nothing_of_what_came_meanwhile(
    program, tmp_path, clock
):
    """The requests of then wait in its socket; the host that sent them is gone."""
    with running(program, tmp_path, CLOCKS[clock]) as (bench, host, dac):
        stop(bench.process)
        wait_until(dac.is_safe)
        time.sleep(WATCHDOG)
        host.kill()
        host.wait(30.0)
        before = len(commanded(dac.entries()))
        go_on(bench.process)
        wait_until(lambda: len(dac.entries()) > before + 5)
        time.sleep(2 * WATCHDOG)
        assert dac.is_safe()
        assert len(commanded(dac.entries())) == before


@pytest.mark.slow
def test_a_bench_that_is_started_anew_obeys_nobody_before_it_is_initialised(program, tmp_path):
    with running(program, tmp_path) as (bench, host, dac):
        bench.process.kill()
        bench.process.wait(30.0)
        wait_until(dac.is_safe)
        before = len(commanded(dac.entries()))
        another = Bench(program, dac, bench.port)
        try:
            time.sleep(3 * WATCHDOG)  # the host asks on
            assert host.poll() is None
            assert len(commanded(dac.entries())) == before
            end(host)
            host = start_host(bench.port)
            wait_until(lambda: len(commanded(dac.entries())) > before)
        finally:
            another.end()
            end(host)


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.slow
def test_a_step_that_fails(program, tmp_path, clock):
    """Nothing is written after it but the safe state."""
    for seed in range(DRAWS):
        fail_at = float(np.random.default_rng(seed).uniform(0.02, 0.1))
        with running(program, tmp_path, CLOCKS[clock], fail_at) as (_, _, dac):
            wait_until(lambda dac=dac: len(commanded(dac.entries())) > 0 and dac.is_safe())
            time.sleep(WATCHDOG)
            entries = dac.entries()
            last = np.flatnonzero((entries["first"] != 0.0) | (entries["second"] != 0.0))[-1]
            assert len(entries) > last + 1
            gap = (entries["ns"][last + 1] - entries["ns"][last]) / 1e9
            assert gap <= PERIOD + SCHEDULING
