"""A start other than 0 s, and an end that an FMU asks for."""

import re
from dataclasses import replace
from math import floor

import numpy as np
import pytest
from grasp_cosim import InputError, System, load_run, simulate
from grasp_cosim.comparison.qualify import qualify
from grasp_cosim.ssp.to_archive import write_ssp
from grasp_cosim.system.parts import Component, Connection, Event, Fault, Port, Realtime
from grasp_cosim.system.stimuli import read_stimuli
from support.marks import ENGINES, engines
from support.mocks import Mock, make_system
from support.mocks import Run as MockRun
from support.native_fmus import KINDS, build_model, needs_cvode, needs_gcc

pytestmark = needs_gcc
START, STEP, STOP = 5.3, 0.1, 7.9
TIMES = np.array([(5_300_000_000 + k * 100_000_000) / 1e9 for k in range(27)])


def system(fmu, more="", table=""):
    path = fmu.with_suffix(".toml")
    path.write_text(
        f"connections = []\n[experiment]\nstep = {STEP}\nstart = {START}\nstop = {STOP}\n{more}"
        f'[components.a]\nfmu = "{fmu.name}"\n{table}'
    )
    return System.load(path)


@needs_cvode
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_foreign_fmu_goes_by_it(tmp_path, version, kind):
    """It counts the zeros of sin(2 pi f t) since the start."""
    fmu = build_model("sine", tmp_path, version, [kind])
    found = simulate(system(fmu, table="values = { f = 0.7 }\n"))
    assert found.time.tolist() == TIMES.tolist()
    expected = [floor(1.4 * t) - floor(1.4 * START) for t in TIMES]
    assert found["a.count"][1:].tolist() == expected[1:]  # at the start its event is yet to come


@needs_cvode
@pytest.mark.parametrize("isolation", ["none", "process"])
@pytest.mark.parametrize("kind", KINDS)
def test_its_time_events_and_its_end_do(tmp_path, kind, isolation):
    fmu = build_model("stair", tmp_path, "3.0", [kind])
    table = f'isolation = "{isolation}"\nvalues = {{ width = 0.5, last = 4 }}\n'
    found = simulate(system(fmu, table=table))
    assert found["a.counter"].tolist() == [1 + floor(k / 5) for k in range(len(found.time))]
    assert found.time[-1] == 6.8
    assert (found.complete, found.ended_at) == (False, 6.8)
    assert found.log[-1] == "a asked for the end of the simulation at t = 6.8 s"


@engines
def test_steps_events_faults_and_stimuli_do(tmp_path, engine):
    """What was due before the start is done there."""
    (tmp_path / "drive.csv").write_text("time,x.u\n0,0\n10,10\n")
    mocks = [Mock(tmp_path, "x", lambda u, t: u), Mock(tmp_path, "z", lambda u, t: u)]
    events = (
        Event({Port("x", "p"): 2.0}, at_ns=6_000_000_000),
        Event({Port("x", "p"): 3.0}, at_ns=1_000_000_000),
    )
    fault = Fault(Port("z", "u"), "bias", {"value": 100.0}, 6_000_000_000, 6_500_000_000)
    made = make_system(
        mocks, [Connection(Port("x", "y"), Port("z", "u"))], 79,
        input=read_stimuli(tmp_path / "drive.csv"), events=events, faults=(fault,),
    )  # fmt: skip
    run = MockRun(replace(made, start_ns=5_300_000_000), mocks, engine)
    found = run.to_the_end()
    begins = np.array([START, *TIMES[:-1]])
    assert run.memory.columns()[0].tolist() == TIMES.tolist()
    assert found["x.y"] == pytest.approx(begins)
    assert found["z.y"][1:] == pytest.approx((begins + 100.0 * (abs(begins - 6.2) < 0.21))[1:])
    assert [call for call in mocks[0].calls if "step" in call][:2] == [
        "step 5.3 0.1",
        "step 5.4 0.1",
    ]
    assert run.master.scenario.log == [
        "t = 5.3 s: x.p = 3.0", "t = 6 s: x.p = 2.0", "t = 6 s: z.u: bias begins",
        "t = 6.5 s: z.u: bias ends",
    ]  # fmt: skip


@pytest.fixture
def later(grasp):
    """The grasp of the paper, two seconds later."""
    return grasp.with_settings({"experiment.start": 2.0, "experiment.stop": 5.0})


def test_what_does_not_go_by_the_clock_is_the_same_later(grasp, later):
    first = simulate(grasp, step=1e-3)
    second = simulate(later, step=1e-3, every=7)
    assert second.time[-1] == 5.0
    for name in ("steady_contact_force", "impact_velocity"):
        assert second.metrics[name] == pytest.approx(first.metrics[name], rel=1e-9)
    contacts = zip(first.metrics["time_to_contact"], second.metrics["time_to_contact"], strict=True)
    for one, other in contacts:
        assert other == pytest.approx(one + 2.0, abs=1e-9)
    assert (second.metrics["steps"], second.settings["start"]) == (3000, 2.0)


def test_in_real_time_sessions_files_and_archives(later, tmp_path):
    with simulate.session(later, step=1e-3, realtime=True) as session:
        assert session.time == 2.0
        session.step(20)
        assert session.time == 2.02
    run = simulate(later, step=1e-3, stop=2.1)
    run.to_csv(tmp_path / "signals.csv")
    run.to_json(tmp_path / "run.json")
    back = load_run(tmp_path)
    assert back.time.tolist() == run.time.tolist() == [(2000 + k) / 1e3 for k in range(101)]
    assert back.metrics["steps"] == 100
    write_ssp(later, tmp_path / "later.ssp")
    again = System.load(tmp_path / "later.ssp")
    assert (again.start_ns, again.stop_ns) == (2_000_000_000, 5_000_000_000)


@pytest.mark.parametrize(
    ("start", "said"),
    [
        (0.25, "step = 0.1 s does not divide stop = 1 s from start = 0.25 s; stop could be 1.05 s"),
        (1.0, "start = 1 s: must be before stop = 1 s"),
        (1e-10, "experiment.start = 1e-10 s: must be a whole number of nanoseconds"),
        ("x", "experiment.start = 'x' s: must be a number"),
    ],
)
def test_one_that_does_not_fit_is_refused(tmp_path, start, said):
    made = make_system([Mock(tmp_path, "x", lambda u, t: u)], [], 10)
    with pytest.raises(InputError, match=re.escape(said)):
        made.with_settings({"experiment.start": start})


BEFORE = "; its values there are in the last row, that of t = "


def stair(folder, kind="CoSimulation", step=0.2, **values):
    """A stair that asks for the end at 9 s, and two that go on, before and behind it."""
    fmu = build_model("stair", folder, "2.0", [kind])
    other = build_model("dahlquist", folder, "2.0")
    parts = (
        Component("first", other, {"u": 1.0}),
        Component("stair", fmu, values),
        Component("last", other, {}),
    )
    connection = (Connection(Port("first", "y"), Port("last", "u")),)
    step_ns = round(step * 1e9)
    return System("stair", parts, connection, step_ns, 60 * step_ns, "sequential")


@needs_cvode
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("step", "end", "said"), [(0.2, 9.0, ""), (0.7, 9.1, f"{BEFORE}9.1 s")])
def test_a_run_ends_with_the_last_sample(tmp_path, kind, engine, step, end, said):
    """The other components are then at the same communication point."""
    system = stair(tmp_path, kind, step)
    result = simulate(system, engine=engine)
    assert (result.complete, result.ended_at) == (False, end)
    assert result.time[-1] == end
    assert result["stair.counter"][[-2, -1]].tolist() == [9, 10]
    assert result.log[-1] == f"stair asked for the end of the simulation at t = 9 s{said}"
    whole = simulate(system.with_values({"stair.last": 1000}))
    for name in ("first.x", "last.x"):
        assert result[name].tolist() == whole[name][: len(result.time)].tolist()


@needs_cvode
def test_the_end_at_the_very_beginning(tmp_path):
    """In the event at the end of the initialisation."""
    system = stair(tmp_path, "ModelExchange", last=1)
    result = simulate(system, realtime=Realtime(factor=1000.0))
    assert (result.complete, result.ended_at) == (False, 0.0)
    assert result.time.tolist() == [0.0]
    assert "stair asked for the end of the simulation at t = 0 s" in result.log[-1]


@pytest.mark.slow
def test_a_candidate_that_ends_sooner_is_not_qualified(tmp_path):
    system = stair(tmp_path, step=0.1, width=0.5)
    fmu = build_model("stair", tmp_path, "3.0", file="other")
    same = qualify(system, "stair", fmu, isolation="none")
    assert same.qualified
    assert [(c.name, c.original, c.candidate) for c in same.metrics] == [("end_of_run", 4.5, 4.5)]
    values = {"width": 0.5, "last": 5}
    sooner = qualify(system, "stair", Component("stair", fmu, values), isolation="none")
    assert not sooner.qualified
    assert [c.name for c in sooner.metrics if not c.inside] == ["end_of_run"]
