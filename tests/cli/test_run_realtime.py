"""run --realtime: what it prints and writes, its mistakes in one line."""

import json
import os

from grasp_cosim.realtime.timing import Overrun, Spread, Timing
from grasp_cosim.recording.load import load_run
from grasp_cosim.report.terminal import timing_lines

PACED = ["run", "--realtime", "--set", "realtime.factor=1000", "--step", "1e-3", "--stop", "0.5"]


def test_the_timing_is_in_the_json_and_in_the_folder(command, tmp_path):
    code, out, err = command(
        *PACED, "--set", "realtime.overrun=continue", "--out", "results", "--json"
    )
    assert (code, err) == (0, "")
    printed = json.loads(out)
    assert printed["realtime"]["steps"] == printed["steps"] == 500
    assert printed["realtime"]["overrun"] == "continue"
    timing = load_run(tmp_path / "results").timing
    assert timing is not None
    assert timing.as_dict() == printed["realtime"]


def test_a_run_that_is_not_paced_says_nothing_of_it(command):
    code, out, _ = command("run", "--stop", "0.01", "--json")
    assert code == 0
    assert "realtime" not in json.loads(out)


def test_people_are_told_how_it_kept_to_the_clock(command):
    code, out, err = command(*PACED, "--python")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    (begin,) = (i for i, line in enumerate(lines) if line.startswith("paced at "))
    assert "of real time, asked for 1000: a step every 0.001 ms" in lines[begin]
    assert lines[begin + 1].startswith("step computes         median ")
    assert lines[begin + 2].startswith("start is late by      median ")
    assert lines[begin + 3].startswith("overruns              500 of 500 steps; because of: ")
    assert "the machine is too slow for this system: a step takes " in lines[-1]


def test_a_run_that_stops_at_an_overrun_fails_and_keeps_its_timing(command, tmp_path):
    code, out, err = command(*PACED, "--set", "realtime.overrun=stop", "--out", "results")
    assert (code, out) == (3, "")
    kept, error = err.splitlines()
    assert kept == "kept what was recorded, in results"
    assert error.startswith("grasp-cosim: grasp.toml: the step at t = 0 s ended ")
    assert error.endswith("ms; must end within 0.001 ms")
    timing = load_run(tmp_path / "results").timing
    assert timing is not None
    assert (timing.overruns, timing.steps) == (1, 1)


def test_a_cpu_that_is_not_there_is_a_mistake(command, monkeypatch, tmp_path):
    (tmp_path / "online").write_text("0-1\n")
    monkeypatch.setattr("grasp_cosim.realtime.pacer.ONLINE", tmp_path / "online")
    code, out, err = command(*PACED, "--set", "realtime.cpu=99", "--out", "results")
    assert (code, out) == (2, "")
    assert err == "grasp-cosim: cpu = 99: no such CPU here; must be one of 0, 1\n"
    assert not (tmp_path / "results").exists()


def test_what_is_refused_is_on_standard_error(command, monkeypatch, caplog):
    monkeypatch.delattr(os, "sched_setaffinity", raising=False)
    code, out, _ = command(*PACED, "--set", "realtime.cpu=0", "--python", "--json")
    assert code == 0
    assert json.loads(out)["realtime"]["refused"] == caplog.messages
    assert caplog.messages == ["CPU 0: not possible on this operating system"]


def timing(culprits, granted=()):
    part = Spread(1e-4, 2e-4, 3e-4, 4e-4, 0.5)
    return Timing(
        factor=1.0, period=1e-3, overrun="catch-up", granted=granted, refused=(), steps=100,
        real_time_factor=1.0, overruns=sum(culprits.values()), culprits=culprits,
        listed=tuple(Overrun(3, 0.003, 2e-4, name, 7e-4) for name in culprits),
        parts={"step": part, "start": part}, histograms={},
    )  # fmt: skip


def test_what_could_be_done_depends_on_who_is_to_blame():
    assert timing_lines(timing({})) == [
        "paced at 1 of real time, asked for 1: a step every 1 ms",
        "step computes         median 0.1  p99 0.2  p99.9 0.3  worst 0.4 ms at t = 0.5 s",
        "start is late by      median 0.1  p99 0.2  p99.9 0.3  worst 0.4 ms at t = 0.5 s",
        "overruns              none: every step ended within its period",
    ]
    lines = timing_lines(timing({"start": 3, "backlog": 9, "plant": 1}))[3:]
    assert lines[:2] == [
        "overruns              13 of 100 steps; because of: start 3, backlog 9, plant 1",
        "  e.g.                at t = 0.003 s 0.2 ms late: it began late by 0.7 ms",
    ]
    assert "give the run a priority and a CPU of its own, --set realtime.prio" in lines[2]
    assert len(timing_lines(timing({"start": 3}, ("CPU 1",)))) == 5
    assert len(timing_lines(timing({"start": 3, "plant": 9}))) == 5
