"""An FMU that asks for the end of the simulation ends the run in good order."""

import json

import pytest
from grasp_cosim import System, simulate
from grasp_cosim.cli.entry import main
from grasp_cosim.comparison.qualify import qualify
from grasp_cosim.recording.load import load_run
from grasp_cosim.system.parts import Component, Connection, Port, Realtime
from support.marks import ENGINES
from support.native_fmus import build_model, needs_cvode, needs_gcc

pytestmark = needs_gcc
KINDS = [pytest.param("ModelExchange", marks=needs_cvode), "CoSimulation"]
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


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("step", "end", "said"), [(0.2, 9.0, ""), (0.7, 9.1, f"{BEFORE}9.1 s")])
def test_a_run_ends_with_the_last_sample(tmp_path, kind, engine, step, end, said):
    """The other components are then at the same communication point."""
    system = stair(tmp_path, kind, step)
    result = simulate(system, engine=engine)  # type: ignore[arg-type]
    assert result.complete
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
    assert result.complete
    assert result.time.tolist() == [0.0]
    assert "stair asked for the end of the simulation at t = 0 s" in result.log[-1]


@pytest.mark.parametrize("kind", KINDS)
def test_a_session_and_real_time(tmp_path, kind):
    system = stair(tmp_path, kind, 0.1, width=0.1)
    with simulate.session(system, realtime=Realtime(factor=100.0)) as session:
        while session.step():
            assert not session.complete or session.time == 0.9
        assert session.complete
        result = session.result()
    assert result.time[-1] == 0.9
    assert result.timing is not None


def test_the_command_is_done(tmp_path, capsys):
    build_model("stair", tmp_path)
    path, out = tmp_path / "stair.toml", tmp_path / "out"
    path.write_text(
        '[experiment]\nstep = 0.1\nstop = 60.0\n[components.stair]\nfmu = "stair.fmu"\n', "utf-8"
    )
    assert main(["run", str(path), "--out", str(out)]) == 0
    assert "stair asked for the end of the simulation at t = 9 s" in capsys.readouterr().err
    assert (out / "signals.csv").read_text("utf-8").splitlines()[-1] == "9.0,10"
    written = json.loads((out / "run.json").read_text("utf-8"))
    assert (written["complete"], written["steps"]) == (True, 90)
    assert load_run(out).complete


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
    assert [c.name for c in sooner.outside] == ["end_of_run"]
