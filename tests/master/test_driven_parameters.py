"""Columns of stimuli that drive tunable parameters, against x' = gain u by hand, and FMPy."""

import re
from dataclasses import replace

import numpy as np
import pytest
from fmpy import simulate_fmu
from grasp_cosim import InputError, System, simulate
from grasp_cosim.system.parts import Component, Event, Port
from support.marks import engines, skip_where_fmpy_runs_none
from support.native_fmus import EVENT_MODE, KINDS, build_model, needs_cvode, needs_gcc
from support.native_systems import REALS, driven

INPUT = '[input]\nfile = "drive.csv"\n'
TIMES = [-1.0, 0.0, 0.15, 0.3, 0.3, 0.55, 0.55, 0.8, 2.0]
GAINS = [9.0, 2.0, 3.0, 4.0, 5.0, 6.0, 6.0, 6.0, 7.0]
POINTS = np.arange(11) * 0.1


def table(real="Real"):
    rows = "".join(f"{t!r},{1.0 + t!r},{gain!r}\n" for t, gain in zip(TIMES, GAINS, strict=True))
    return f"time,a.u_{real},a.gain\n{rows}"


def held(times, values, at):
    """The value of the last row at or before each time, before the first one that."""
    rows = np.searchsorted(np.asarray(times), np.asarray(at) + 1e-9, side="right") - 1
    return np.asarray(values)[np.maximum(rows, 0)]


def integral(own=0.1):
    """x of the integrator that gets u and gain at the beginning of each of its own steps."""
    begins = np.arange(round(1.0 / own)) * own
    return np.cumsum(own * held(TIMES, GAINS, begins) * (1.0 + begins))


@needs_gcc
@engines
@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
def test_it_has_the_value_of_the_last_row_at_the_beginning_of_each_step(
    engine, version, scheme, tmp_path
):
    path = driven(tmp_path, table(REALS[version]), version, more=INPUT)
    result = simulate(System.load(path), engine=engine, scheme=scheme)
    assert result["a.x"][0] == 0.0
    assert result["a.x"][1:] == pytest.approx(integral(), rel=1e-12)
    line = f"drive.csv drives a.u_{REALS[version]} (linear), a.gain (held), each step by the values"
    assert [said.startswith(line) for said in result.log if "gain" in said] == [True]


@needs_gcc
@engines
def test_with_an_own_step_it_changes_at_its_own_points(engine, tmp_path):
    path = driven(tmp_path, table(), more=INPUT, own="step = 0.5")
    x = simulate(System.load(path), engine=engine)["a.x"]
    assert x[[0, 5, 10]] == pytest.approx([0.0, *integral(0.5)], rel=1e-12)


@needs_gcc
@pytest.mark.slow
def test_in_a_process_of_its_own_it_has_the_same_bits(tmp_path):
    path = driven(tmp_path, table(), more=INPUT)
    here = simulate(System.load(path))
    alone = simulate(System.load(driven(tmp_path, table(), more=INPUT, own='isolation="process"')))
    assert alone["a.x"].tobytes() == here["a.x"].tobytes()


@needs_gcc
@engines
@pytest.mark.parametrize("engine_rows", [[1, 2, 3]])
def test_thirds_of_a_second_are_at_their_points(engine, engine_rows, tmp_path):
    """Rows are taken to the nanosecond; 2/3 s, rounded up to one, is not late by a step."""
    rows = "".join(f"{k / 3!r},{k + 1.0},{k + 1.0}\n" for k in range(4))
    path = driven(tmp_path, f"time,a.u_Integer,a.gain\n{rows}", more=INPUT, step='"1/3"')
    result = simulate(System.load(path), engine=engine)
    assert result["a.y_Integer"][1:].tolist() == engine_rows


@needs_gcc
@needs_cvode
@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("kind", KINDS)
def test_either_kind_of_fmu_takes_it(version, kind, tmp_path):
    """dahlquist, x' = -k x, by CVode or by itself."""
    build_model("dahlquist", tmp_path, version, [kind])
    (tmp_path / "k.csv").write_text("time [ms];a.k;a.u\n0;1;0\n400;2;0\n", "utf-8-sig")
    (tmp_path / "s.toml").write_text(
        "connections = []\n[experiment]\nstep = 0.1\nstop = 1.0\n"
        "[components.a]\nfmu = 'dahlquist.fmu'\n"
    )
    result = simulate(System.load(tmp_path / "s.toml", input=tmp_path / "k.csv"))
    exact = np.exp(-np.where(POINTS <= 0.4, POINTS, 2.0 * POINTS - 0.4))
    assert result["a.x"] == pytest.approx(exact, rel=1e-8)


@needs_gcc
@engines
@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
def test_an_fmu_with_event_mode_gets_it_there(engine, scheme, tmp_path):
    """A ball that bounces less from 1 s on; the FMU refuses parameters in step mode."""
    fmu = build_model("bouncing_ball", tmp_path, "3.0", ["CoSimulation"], capabilities=EVENT_MODE)
    ball = Component("b", fmu, {})
    system = System("ball", (ball,), (), 10_000_000, 2_000_000_000, scheme)
    (tmp_path / "e.csv").write_text("time,b.e\n0,0.7\n1,0.4\n")
    column = simulate(system.with_input(tmp_path / "e.csv"), engine=engine)
    event = Event({Port("b", "e"): 0.4}, at_ns=1_000_000_000)
    assert column["b.h"].tobytes() == simulate(replace(system, events=(event,)))["b.h"].tobytes()
    assert column["b.h"].tobytes() != simulate(system)["b.h"].tobytes()


@needs_gcc
def test_so_does_fmpy(tmp_path):
    """Of rows at communication points; at others FMPy ends a step there."""
    skip_where_fmpy_runs_none("3.0")
    table = [(0.0, 1.0, 2.0), (0.3, 1.0, 5.0), (1.0, 1.0, 3.0)]
    text = "".join(f"{t},{u},{gain}\n" for t, u, gain in table)
    path = driven(tmp_path, f"time,a.u_Float64,a.gain\n{text}", "3.0", more=INPUT)
    result = simulate(System.load(path))
    rows = np.array(table, [("time", float), ("u_Float64", float), ("gain", float)])
    theirs = simulate_fmu(
        str(tmp_path / "native.fmu"), stop_time=1.0, output_interval=0.1, step_size=0.1,
        input=rows, output=["x"], fmi_type="CoSimulation",
    )  # fmt: skip
    assert theirs["time"] == pytest.approx(result.time, abs=1e-12)
    assert theirs["x"] == pytest.approx(result["a.x"], rel=1e-12)


@needs_gcc
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,a.u_Real,a.error_at\n0,1,1\n", "column 3, a.error_at: is a fixed parameter, which"),
        ("time,a.u_Real,a.x\n0,1,1\n", "a.x: is a continuous output, which cannot be set in the"),
        (
            "time,a.u_Real,a.gian\n0,1,1\n",
            "parameter 'a.gian'; did you mean a.gain",
        ),
        ("time,a.u_Real,a.gain\n0,1,one\n", "line 2, column 3, a.gain: gain = 'one': must be"),
    ],
)
def test_what_cannot_be_driven_is_refused_by_reason(text, said, tmp_path):
    with pytest.raises(InputError, match=re.escape(said)):
        System.load(driven(tmp_path, text, more=INPUT))


@needs_gcc
def test_it_has_one_source_and_refuses_what_the_fmu_refuses(tmp_path):
    system = System.load(driven(tmp_path, table(), more=INPUT))
    event = "[[events]]\nat = 0.5\nset = { 'a.gain' = 1.0 }\n"
    with pytest.raises(InputError, match=r"a\.gain has two sources, drive.csv and an event"):
        System.load(driven(tmp_path, table(), more=INPUT + event))
    assert simulate(system.with_values({"a.gain": 50.0}))["a.x"][1] == pytest.approx(0.2)
    with (
        simulate.session(system) as session,
        pytest.raises(InputError, match=r"set: a\.gain: is driven by a column"),
    ):
        session.set("a.gain", 1.0)


@needs_gcc
def test_a_unit_for_what_has_none_is_said(tmp_path):
    text = "time,a.u_Real [kN],a.gain [mm]\n0,1,2\n"
    result = simulate(System.load(driven(tmp_path, text, more=INPUT)))
    assert result["a.x"][1] == pytest.approx(0.1 * 1000.0 * 2.0)
    line = "drive.csv: a.gain has no unit, taken to be in mm"
    assert line in result.log
    assert not [said for said in result.log if "u_Real has" in said]
