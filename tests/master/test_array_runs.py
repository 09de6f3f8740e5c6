"""Arrays in a run: a state-space model against its exact solution and FMPy, and all types."""

import json

import numpy as np
import pytest
from grasp_cosim import System, simulate
from grasp_cosim.cli.entry import main
from grasp_cosim.recording.read_back import load_run
from scipy.linalg import expm
from support.marks import engines
from support.native_fmus import ARRAY_TYPES as TYPES
from support.native_fmus import needs_gcc, state_space

pytestmark = needs_gcc
STEP, STOP = 0.125, 2.0


def load(folder, tables, connections="", scheme="sequential", types=True, kind="CoSimulation"):
    """A system of ss.fmu."""
    state_space(folder, types=types, kind=kind)
    path = folder / "system.toml"
    path.write_text(
        f"connections = [{connections}]\n[experiment]\nstep = {STEP}\nstop = {STOP}\n"
        f'scheme = "{scheme}"\n{tables}',
        "utf-8",
    )
    return System.load(path)


def alone(folder):
    return load(folder, '[components.ss]\nfmu = "ss.fmu"\n', types=False)


def two(folder, connections, more="", scheme="sequential"):
    tables = '[components.a]\nfmu = "ss.fmu"\n[components.b]\nfmu = "ss.fmu"\n'
    return load(folder, tables + more, connections, scheme)


def values_of(n, m, r, seed=1):
    """A stable system of that many states, inputs and outputs."""
    draw = np.random.default_rng(seed).normal
    a = draw(size=(n, n)) - 2.0 * np.eye(n)
    b, c, d = draw(size=(n, m)), draw(size=(r, n)), draw(size=(r, m))
    return {"A": a, "B": b, "C": c, "D": d, "x0": draw(size=n), "u": draw(size=m)}


def exact(given):
    """y at each step, for an input that is held."""
    a, b, c, d, x, u = (given[k] for k in ("A", "B", "C", "D", "x0", "u"))
    n, m = b.shape
    whole = np.zeros((n + m, n + m))
    whole[:n] = np.hstack([a, b])
    power = expm(STEP * whole)[:n]
    rows = []
    for _ in range(round(STOP / STEP) + 1):
        rows.append(c @ x + d @ u)
        x = power @ np.concatenate([x, u])
    return np.array(rows)


def signals(result, name, count):
    return np.array([result[f"{name}[{i}]"] for i in range(1, count + 1)]).T


@engines
@pytest.mark.parametrize("sizes", [(3, 3, 3), (1, 1, 1), (7, 2, 5), (2, 6, 1), (24, 4, 3)])
def test_a_state_space_model_is_exact(tmp_path, engine, sizes):
    given = values_of(*sizes)
    values = dict(zip(("ss.n", "ss.m", "ss.r"), sizes, strict=True))
    values |= {f"ss.{name}": value for name, value in given.items()}
    result = simulate(alone(tmp_path).with_values(values), engine=engine)
    np.testing.assert_allclose(signals(result, "ss.y", sizes[2]), exact(given), 1e-10, 1e-12)
    assert list(result.signals) == [f"ss.y[{i}]" for i in range(1, sizes[2] + 1)]


@engines
@pytest.mark.parametrize("isolation", ["none", pytest.param("process", marks=pytest.mark.slow)])
def test_stimuli_drive_elements(tmp_path, engine, isolation):
    (tmp_path / "drive.csv").write_text("time,ss.u[2]\n0,1\n1,3\n", "utf-8")
    table = '[components.ss]\nfmu = "ss.fmu"\nvalues = { C = 0 }\n[input]\nfile = "drive.csv"\n'
    system = load(tmp_path, table, types=False)
    system = system.with_settings({"components.ss.isolation": isolation})
    found = signals(simulate(system, engine=engine), "ss.y", 3)
    times = np.arange(17) * STEP - STEP
    assert found[1:, 1].tolist() == np.interp(times[1:], [0.0, 1.0], [1.0, 3.0]).tolist()
    assert found[:, [0, 2]].tolist() == [[1.0, 3.0]] * 17


@engines
@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
def test_whole_arrays_and_their_elements_are_connected(tmp_path, engine, scheme):
    parts = [f"a.y[{i}] -> b.u[{i}]" for i in (3, 1, 2)]
    ends = '{ from = "a.y_Float32", to = "b.u_Float32", factor = 2.0 }'
    whole = simulate(two(tmp_path, f'"a.y -> b.u", {ends}', "", scheme), engine=engine)
    listed = ", ".join(f'"{part}"' for part in parts)
    by_part = simulate(two(tmp_path, f"{listed}, {ends}", "", scheme), engine=engine)
    for name in whole.signals:
        np.testing.assert_array_equal(whole[name], by_part[name], name)
    assert whole["b.y[3]"][-1] > whole["a.y[3]"][-1] > 3.0


@engines
def test_the_rest_of_an_array_keeps_its_value_or_start(tmp_path, engine):
    """B = D = 0 but for one row, so that y[1] is u[2] and so on."""
    system = two(tmp_path, '"a.y[1] -> b.u[2]"').with_values(
        {"a.C": 0, "a.D": 0, "a.D[1,3]": 1.0, "a.u[3]": 9.0}
        | {"b.C": 0, "b.D": np.eye(3), "b.u[3]": -1.5}
    )
    result = simulate(system, engine=engine)
    assert signals(result, "b.y", 3)[[0, -1]].tolist() == [[1.0, 9.0, -1.5]] * 2
    assert "b: no source for u[1], u_Float64, " in " ".join(result.log)


@engines
def test_all_types_pass_whole(tmp_path, engine):
    links = ", ".join(f'"a.y_{t} -> b.u_{t}"' for t in TYPES)
    given = {
        f"a.u_{t}": np.arange(6).reshape(2, 3) + 1 if "Int" in t else [[1.5] * 3, [-0.25] * 3]
        for t in TYPES[:-2]
    }
    given["a.u_Boolean"] = [[True, False, True], [False, False, True]]
    given["a.u_Enumeration"] = [["slow", "fast", "slow"], ["fast", "fast", "slow"]]
    result = simulate(two(tmp_path, links).with_values(given), engine=engine)
    expected = {t: np.ravel(given[f"a.u_{t}"]).tolist() for t in TYPES[:-1]}
    expected["Enumeration"] = [1, 2, 1, 2, 2, 1]
    for t in TYPES:
        places = [f"[{i},{j}]" for i in (1, 2) for j in (1, 2, 3)]
        for component in "ab":
            found = [result[f"{component}.y_{t}{place}"][-1] for place in places]
            assert found == expected[t], t


@engines
def test_events_set_elements_of_arrays(tmp_path, engine):
    more = (
        '[[events]]\nat = 0.5\nset = { "b.u[3]" = 4.0, "a.u[2]" = 7.0, "a.D[1,1]" = 0.0 }\n'
        "[[events]]\nwhen = \"a.y_Enumeration[2,1] == 'fast'\"\n"
        'set = { "b.u_Int16[1,2]" = 77 }\n'
        '[[events]]\nat = 1.0\nset = { "a.u_Enumeration[2,1]" = "fast" }\n'
    )
    system = two(tmp_path, '"a.y[1] -> b.u[1]", "a.y[2] -> b.u[2]"', more).with_values(
        {"a.C": 0, "a.D": np.eye(3), "b.C": 0, "b.D": np.eye(3)}
    )
    result = simulate(system, engine=engine)
    before, after = 4, 5
    assert signals(result, "b.y", 3)[before].tolist() == [1.0, 2.0, 3.0]
    assert signals(result, "a.y", 3)[after].tolist() == [0.0, 7.0, 3.0]
    assert signals(result, "b.y", 3)[after].tolist() == [0.0, 7.0, 4.0]
    assert result["b.y_Int16[1,2]"][[9, 10]].tolist() == [0, 77]
    assert "t = 1.125 s: b.u_Int16[1,2] = 77 (a.y_Enumeration[2,1] == 'fast')" in result.log


@engines
def test_events_set_whole_arrays(tmp_path, engine):
    more = (
        '[[events]]\nat = 0.5\nset = { "a.D" = [[0, 0, 0], [0, 2, 0], [0, 0, 1]], "b.u" = 4 }\n'
        "[[events]]\nat = 1.0\nset = { 'b.u' = [5.0, 6.0, 7.0] }\n"
    )
    system = two(tmp_path, "", more).with_values(
        {"a.C": 0, "a.D": np.eye(3), "b.C": 0, "b.D": np.eye(3)}
    )
    result = simulate(system, engine=engine)
    assert signals(result, "a.y", 3)[[4, 5]].tolist() == [[1.0, 2.0, 3.0], [0.0, 4.0, 3.0]]
    rows = signals(result, "b.y", 3)[[4, 5, 9]].tolist()
    assert rows == [[1.0, 2.0, 3.0], [4.0, 4.0, 4.0], [5.0, 6.0, 7.0]]
    assert "t = 1 s: b.u = [5.0, 6.0, 7.0]" in result.log
    assert result.settings["events"][1]["set"] == {"b.u": [5.0, 6.0, 7.0]}


def test_a_session_sets_a_whole_array(tmp_path):
    system = alone(tmp_path).with_values({"ss.C": 0, "ss.D": np.eye(3)})
    with simulate.session(system) as session:
        for given in (np.array([7.0, 8.0, 9.0]), [4.0, 5.0, 6.0]):
            session.set("ss.u", given)
            assert session.step()
            given[0] += 1.0  # which is the caller's own
            assert [session[f"ss.y[{i}]"] for i in (2, 3)] == list(given[1:])
            assert session["ss.y[1]"] == given[0] - 1.0
        first, last = "t = 0 s: ss.u = [7.0, 8.0, 9.0]", "ss.u = [4.0, 5.0, 6.0]"
        assert session.result().log[-1] == f"{first}; set 2 times, the last at t = 0.125 s: {last}"


def test_a_recorded_run_reads_back(tmp_path):
    two(tmp_path, '"a.y -> b.u"')
    out, file = tmp_path / "out", str(tmp_path / "system.toml")
    assert main(["run", file, "--set", "a.u=4,5,6", "--set", "b.A[1,2]=2", "--out", str(out)]) == 0
    result = simulate(System.load(file).with_values({"a.u": [4, 5, 6], "b.A[1,2]": 2}))
    assert '"a.y_Float64[1,2]"' in (out / "signals.csv").read_text("utf-8").partition("\n")[0]
    written = json.loads((out / "run.json").read_text("utf-8"))["components"]
    assert written["a"]["values"] == {"u[1]": 4.0, "u[2]": 5.0, "u[3]": 6.0}
    assert written["b"]["values"] == {"A[1,2]": 2.0}
    read = load_run(out)
    assert list(read.signals) == list(result.signals)
    for name in result.signals:
        np.testing.assert_array_equal(read[name], result[name])
