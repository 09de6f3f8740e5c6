"""The interpreted and the compiled loop give the same bits, the same errors, the same rows."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from grasp_cosim import SimulationError, simulate
from grasp_cosim.master import engine as engines
from grasp_cosim.master.plan import Plan
from grasp_cosim.recording.result import Rejection
from grasp_cosim.system.parts import Connection, Port
from support.cases import CASES
from support.marks import needs_compiler
from support.mocks import Mock, Run, make_system

pytestmark = needs_compiler
ENGINES = ("python", "compiled")


def both(system, **options):
    one, two = (simulate(system, engine=engine, **options) for engine in ENGINES)
    return one, two


def assert_same_bits(one, two):
    assert list(one) == list(two)
    assert one.time.tobytes() == two.time.tobytes()
    assert [n for n in one if one[n].tobytes() != two[n].tobytes()] == []


@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
@pytest.mark.parametrize(("case", "step"), [(0, 2e-4), (1, 1e-3), (2, 1e-3)])
def test_the_grasp(grasp, case, step, scheme):
    stop = 0.4 if case == 0 else 2.5
    assert_same_bits(*both(grasp.with_values(CASES[case]), step=step, stop=stop, scheme=scheme))


@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
def test_slow_sensors_and_scaled_connections(grasp, scheme):
    components = tuple(
        replace(c, step_ns=3_000_000) if c.name == "sensor_1" else c for c in grasp.components
    )
    first, *others = grasp.connections
    connections = (replace(first, factor=1.1, offset=-0.003), *others)
    system = replace(
        grasp,
        components=components,
        connections=connections,
        step_ns=1_000_000,
        stop_ns=2_400_000_000,
    )
    one, two = both(system, scheme=scheme)
    assert_same_bits(one, two)
    held = one["sensor_1.intensity"]
    assert (held[3:6] == held[3]).all()
    assert held[6] != held[5]


def test_decimation_keeps_each_nth_row_and_the_last(grasp):
    whole = simulate(grasp, step=1e-3, stop=0.1)
    for few in both(grasp, step=1e-3, stop=0.1, every=7):
        kept = [*range(0, 101, 7), 100]
        assert few.time.tolist() == whole.time[kept].tolist()
        assert all((few[name] == whole[name][kept]).all() for name in whole)
        assert few.metrics["steps"] == 100


@pytest.mark.parametrize("engine", ENGINES)
def test_an_fmu_that_fails_is_the_same_error(grasp, altered, engine):
    nan = "l = float('nan') if u.gap < 0.044 else u.gap"
    fmu = altered(
        "ProximitySensor", "proximity_sensor/optics.py", "l = 0.0 if u.gap < 0.0 else u.gap", nan
    )
    with pytest.raises(SimulationError, match=r"^sensor_1: .* at t = 0\.061 s: ") as caught:
        simulate(grasp.swap("sensor_1", fmu), engine=engine)
    assert caught.value.result is not None
    assert len(caught.value.result.time) == 611
    assert not caught.value.result.complete


def chain(tmp_path, engine, *mocks):
    connections = [Connection(Port(a.name, "y"), Port(b.name, "u")) for a, b in pairwise(mocks)]
    return Run(make_system(mocks, connections), mocks, engine)


@pytest.mark.parametrize("engine", ENGINES)
def test_rejected_steps_are_resolved_in_both(tmp_path, engine):
    clock = Mock(tmp_path, "clock", lambda u, t: t, direct=False)
    slow = Mock(
        tmp_path, "slow", lambda u, t: t, direct=False,
        rejects=lambda begin, end: 0.13 if begin < 0.13 < end else end,
    )  # fmt: skip
    run = chain(tmp_path, engine, slow, clock)
    signals = run.to_the_end()
    assert signals["slow.y"] == pytest.approx(signals["clock.y"], abs=1e-15)
    assert run.master.rejections == {"slow": Rejection(1, 0.1)}


@pytest.mark.parametrize("engine", ENGINES)
def test_what_a_call_raises_ends_the_run(tmp_path, engine):
    """An exception must not get lost in compiled code."""

    def output(u, t):
        if t > 0.25:
            raise SimulationError("a: enough")
        return t

    run = chain(tmp_path, engine, Mock(tmp_path, "a", output, direct=False))
    with pytest.raises(SimulationError, match="a: enough"):
        run.to_the_end()
    assert run.signals()["a.y"] == pytest.approx([0.0, 0.1, 0.2])


@pytest.mark.parametrize("engine", ENGINES)
def test_a_value_that_is_not_finite_at_t_0_is_kept_too(tmp_path, engine, monkeypatch):
    mock = Mock(tmp_path, "a", lambda u, t: math.nan)
    monkeypatch.setattr("grasp_cosim.master.simulation.load", lambda component: mock)
    with pytest.raises(SimulationError, match=r"^a\.y = nan at step 0: must be finite") as caught:
        simulate(make_system([mock], []), engine=engine)
    assert caught.value.result is not None
    assert caught.value.result.time.tolist() == [0.0]
    assert not caught.value.result.complete
    assert mock.calls[-1] == "close"


@pytest.mark.parametrize("compiler", [True, False])
@pytest.mark.parametrize("there", [True, False])
@pytest.mark.parametrize("steps", [1, engines.LONG - 1, engines.LONG, None])
def test_auto_takes_it_where_it_is_there_and_builds_it_for_long_runs(
    monkeypatch, there, compiler, steps
):
    monkeypatch.setattr(engines, "is_there", lambda: there)
    monkeypatch.setattr(engines, "has_compiler", lambda: compiler)
    monkeypatch.setattr(engines, "CompiledLoop", lambda plan: "in C")
    found = engines.make_loop(Plan(np.zeros(1), np.zeros(2)), "auto", steps)
    long = steps in (engines.LONG, None)
    assert (found == "in C") is (there or (long and compiler))
