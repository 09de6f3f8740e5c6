"""Runs whose inputs a CSV file drives: the values of each step, as FMPy's simulate_fmu has them."""

import numpy as np
import pytest
from fmpy import simulate_fmu
from grasp_cosim import InputError, System, simulate
from grasp_cosim.system.stimuli import read_stimuli
from hypothesis import given
from hypothesis import strategies as st
from support.marks import engines, examples, skip_where_fmpy_runs_none
from support.native_fmus import build, needs_gcc
from support.native_systems import REALS, driven

pytestmark = needs_gcc
INPUT = '[input]\nfile = "drive.csv"\n'
TEXT = """time,a.u_{0},a.u_Boolean,a.u_Enumeration
-1,0,0,1
0.2,0,1,2
0.37,0.9,1,2
0.5,1.0,1,1
0.5,3.0,0,1
0.8,3.5,0,2
"""
ROWS = [tuple(map(float, line.split(","))) for line in TEXT.splitlines()[1:]]


def column(result, name):
    return [float(x) for x in result[name]]


@engines
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_values_are_those_of_fmpy(engine, version, tmp_path):
    skip_where_fmpy_runs_none(version)
    real = REALS[version]
    result = simulate(
        System.load(driven(tmp_path, TEXT.format(real), version, INPUT)), engine=engine
    )
    names = [f"u_{real}", "u_Boolean", "u_Enumeration"]
    kinds = [np.double, np.bool_, np.int32]
    rows = np.array(ROWS, dtype=[("time", np.double), *zip(names, kinds, strict=True)])
    outputs = [name.replace("u_", "y_") for name in names]
    theirs = simulate_fmu(
        str(tmp_path / "native.fmu"), stop_time=1.0, output_interval=0.1, step_size=0.1,
        input=rows, output=[*outputs, "x"], fmi_type="CoSimulation",
    )  # fmt: skip
    assert np.allclose(theirs["time"], result.time, rtol=0.0, atol=1e-12)
    for name in [*outputs, "x"]:
        assert np.allclose(theirs[name], column(result, f"a.{name}"), rtol=0.0, atol=1e-12), name
    assert len(set(column(result, f"a.y_{real}"))) > 6


@engines
def test_held_holds_reals_too(engine, tmp_path):
    text = "time,a.u_Real\n0.25,1\n0.5,2\n0.5,3\n2,9\n"
    path = driven(tmp_path, text, more=INPUT + 'interpolation = "held"\n')
    result = simulate(System.load(path), engine=engine)
    assert column(result, "a.y_Real")[1:] == [1.0] * 5 + [3.0] * 5
    result = simulate(System.load(path, input=read_stimuli(tmp_path / "drive.csv")), engine=engine)
    assert column(result, "a.y_Real")[-1] == pytest.approx(3.0 + 6.0 * 0.4 / 1.5)


@engines
@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
def test_an_own_step_takes_the_value_at_its_beginning(engine, scheme, tmp_path):
    path = driven(tmp_path, "time,a.u_Real\n0,0\n1,1\n", more=INPUT, own="step = 0.5")
    result = simulate(System.load(path), engine=engine, scheme=scheme)
    assert column(result, "a.y_Real") == [0.0] * 10 + [0.5]
    assert column(result, "a.x") == [0.0] * 10 + [0.25]


@given(
    times=st.lists(st.integers(-3, 13), min_size=1, max_size=6).map(sorted),
    values=st.lists(st.floats(-1e6, 1e6), min_size=6, max_size=6),
)
@examples(25)
def test_both_engines_give_the_same_bits(times, values, tmp_path_factory):
    folder = tmp_path_factory.mktemp("drawn")
    rows = "".join(f"{0.1 * t!r},{v!r}\n" for t, v in zip(times, values, strict=False))
    system = System.load(driven(folder, f"time,a.u_Real\n{rows}", more=INPUT))
    runs = [column(simulate(system, engine=e), "a.y_Real") for e in ("python", "auto")]
    assert runs[0] == runs[1]
    known = [t * 0.1 for t in times]
    last = {round(t, 1): v for t, v in zip(known, values, strict=False)}
    for k, y in enumerate(runs[0][1:]):
        if round(0.1 * k, 1) in last:
            assert y == last[round(0.1 * k, 1)]


def test_the_first_output_agrees_with_the_first_value(tmp_path):
    result = simulate(System.load(driven(tmp_path, "time,a.u_Real\n0,5\n1,6\n", more=INPUT)))
    assert column(result, "a.y_Real")[:2] == [5.0, 5.0]


def test_a_session_goes_along_and_does_not_set_what_is_driven(tmp_path):
    system = System.load(driven(tmp_path, "time,a.u_Real\n0,0\n1,1\n", more=INPUT))
    with simulate.session(system) as session:
        session.step(6)
        assert session["a.u_Real"] == pytest.approx(0.5)
        with pytest.raises(InputError, match=r"a.u_Real: has a column in drive.csv"):
            session.set("a.u_Real", 1.0)


def test_a_swap_to_another_unit_keeps_what_is_meant(tmp_path):
    build(tmp_path, "milli", "2.0", {"u_Real": "mm"})
    path = driven(tmp_path, "time,a.u_Real\n0,2\n", more=INPUT)
    build(tmp_path, "native", "2.0", {"u_Real": "m"})
    with pytest.raises(InputError, match=r"or an input file, is meant in m; must be in that"):
        System.load(path).swap("a", tmp_path / "milli.fmu")
    (tmp_path / "drive.csv").write_text("time,a.u_Real [cm]\n0,2\n", "utf-8")
    for system, value in (
        (System.load(path), 0.02),
        (System.load(path).swap("a", tmp_path / "milli.fmu"), 20.0),
    ):
        assert column(simulate(system), "a.y_Real") == [value] * 11
