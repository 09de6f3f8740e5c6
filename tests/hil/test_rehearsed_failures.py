"""Failures that a server rehearses, and what a run comes to with them."""

import re
import subprocess
import sys
from contextlib import contextmanager

import pytest
from grasp_cosim import simulate
from grasp_cosim.base.errors import InputError, SimulationError
from grasp_cosim.hil.rehearsal import FAILURES, MEANINGS, Rehearsal, Rehearsed, end_at_once
from grasp_cosim.hil.served import Service
from support.proxies import ANY_PORT, build_proxy, serving

ENGINE = "python"
"""The servers are threads of this process: see test_closed_loop.py."""


def test_a_failure_happens_once_and_so_long_after_the_first_step():
    rehearsal = Rehearsal(Rehearsed.read("mute@0.5"))
    assert (rehearsal.due(True), rehearsal.happens(10**12, True)) == (None, None)
    rehearsal.note_step(100)
    rehearsal.note_step(200)
    assert rehearsal.due(False) == 500_000_100
    assert rehearsal.happens(500_000_099, True) is None
    assert rehearsal.happens(500_000_100, False) == "mute"
    assert rehearsal.happens(10**12, True) is None
    assert (rehearsal.happened, rehearsal.due(True)) == ("mute", None)


@pytest.mark.parametrize("failure", ["fail", "trip"])
def test_what_needs_a_session_waits_for_one(failure):
    rehearsal = Rehearsal(Rehearsed(failure, 0.0))
    rehearsal.note_step(100)
    assert (rehearsal.due(False), rehearsal.happens(200, False)) == (None, None)
    assert rehearsal.due(True) == 100
    assert rehearsal.happens(200, True) == failure


@pytest.mark.parametrize(
    "text", ["mute", "mute@1000001", "sulk@1", "mute@", "mute@-1", "mute@1.2.3", "@1"]
)
def test_failures_that_are_none(text):
    with pytest.raises(
        InputError, match=rf"--fault '{text}': must be FAILURE@SECONDS, of kill, stop"
    ):
        Rehearsed.read(text)


@contextmanager
def benched(grasp, folder, failure, **settings):
    """The grasp with the plant at a server in lockstep, which fails after its first step."""
    fmu = grasp.component("plant", "test").fmu
    proxy = build_proxy(fmu, folder / "Bench.fmu", ANY_PORT)
    rehearsed = Rehearsed(failure, 0.0)
    with serving(fmu, Service(lockstep=True), rehearsed=rehearsed) as server:
        values = {"port": server.address[1], "timeout": 0.2, "misses_tolerated": 1, **settings}
        system = grasp.swap("plant", proxy).with_experiment(step=4e-3, stop=0.4)
        yield system.with_values({f"plant.proxy.{n}": v for n, v in values.items()}), server


@pytest.mark.parametrize(
    ("failure", "reason"),
    [
        *((f, "2 missed in a row: no answer within 0.2 s") for f in ("stop", "mute", "deaf")),
        ("restart", "the peer does not know this session"),
        ("replace", "the peer does not know this session"),
        ("fail", "the peer failed: the model failed, as --fault says"),
        ("trip", "its watchdog or a limit of its own tripped, it is in its safe state"),
    ],
)
def test_a_run_ends_and_says_what_the_bench_did(grasp, tmp_path, failure, reason):
    with (
        benched(grasp, tmp_path, failure) as (system, server),
        pytest.raises(SimulationError, match=re.escape(f"is lost: {reason}")) as error,
    ):
        simulate(system, engine=ENGINE)
    result = error.value.result
    assert not result.passed
    if failure == "mute":  # it heard, and made the steps
        assert server.fmu.counters()["steps"] > len(result.time) - 1


@pytest.mark.slow
@pytest.mark.parametrize("failure", ["restart", "fail", "trip"])
def test_a_run_that_may_begins_anew(grasp, tmp_path, failure):
    settings = {"on_loss": "hold", "resume": True}
    with benched(grasp, tmp_path, failure, **settings) as (system, _):
        result = simulate(system, engine=ENGINE)
    assert len(result.initialised_anew) == 1
    assert result.complete
    failed = {criterion.name for criterion in result.verdict if not criterion.passed}
    assert {"lost", "initialised_anew"} <= failed
    assert ("trips" in failed) == (failure == "trip")


@pytest.mark.slow
def test_one_that_is_killed(grasp, tmp_path):
    fmu = grasp.component("plant", "test").fmu
    command = [sys.executable, "-m", "grasp_cosim", "serve", str(fmu), "--lockstep", "--port", "0"]
    proxy = build_proxy(fmu, tmp_path / "Bench.fmu", ANY_PORT)
    with subprocess.Popen([*command, "--fault", "kill@0"], stderr=subprocess.PIPE, text=True) as s:
        try:
            line = next(line for line in s.stderr if line.startswith("serving "))
            port = int(line.partition(", ")[0].rpartition(":")[2])
            system = grasp.swap("plant", proxy).with_experiment(step=4e-3, stop=0.4)
            with pytest.raises(SimulationError, match="is lost"):
                simulate(system.with_values({"plant.proxy.port": port, "plant.proxy.timeout": 0.2}))
            assert s.wait(30.0) == 137
        finally:
            s.kill()


def test_the_help_says_what_each_is():
    assert [part.partition(":")[0] for part in MEANINGS.split(". ")] == [*FAILURES]


def test_a_bench_that_was_replaced_gets_no_commands(grasp, tmp_path):
    """It is called otherwise: the proxy goes on asking, and is refused, to the end of the run."""
    settings = {"on_loss": "hold", "resume": True, "timeout": 0.05}
    with benched(grasp, tmp_path, "replace", **settings) as (system, server):
        result = simulate(system.with_experiment(stop=0.04), engine=ENGINE)
        counts = server.fmu.counters()
    assert result.initialised_anew == ()
    assert counts["other_name"] > 0
    assert counts["steps"] <= 2


def test_one_that_is_killed_ends_as_by_sigkill(monkeypatch):
    codes = []
    monkeypatch.setattr("os._exit", codes.append)
    end_at_once()
    assert codes == [137]
