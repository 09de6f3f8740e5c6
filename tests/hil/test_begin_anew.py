"""A loop that is initialised again: a peer was lost and is back, or the run has stalled."""

import time

import numpy as np
import pytest
from grasp_cosim import simulate
from grasp_cosim.base.errors import InputError, SimulationError
from grasp_cosim.hil.served import Service
from grasp_cosim.system.parts import Realtime
from support.processes import kept_port
from support.proxies import ANY_PORT, build_proxy, serving

ENGINE = "python"
"""The peers are threads of this process: see test_closed_loop.py."""

LOCKSTEP = Service(lockstep=True)


def largest(result, rows=slice(None)):
    """The largest force that was commanded, in N."""
    return max(np.abs(result[f"controller.force[{j}]"][rows]).max() for j in (1, 2))


LOSES = {"on_loss": "failsafe", "hold.gap[1]": True, "failsafe.gap[2]": 0.25}
"""What a lost plant puts out."""


@pytest.fixture
def bench(grasp, tmp_path):
    """Makes a system with the plant behind a proxy, whose peer is at a port of this machine."""
    fmu = grasp.component("plant", "test").fmu

    def make(port, step=0.01, **settings):
        system = grasp.with_experiment(step=step, stop=4.0)
        system = system.swap("plant", build_proxy(fmu, tmp_path / "Bench.fmu", ANY_PORT))
        values = {"timeout": 0.05, "misses_tolerated": 2, **LOSES, **settings, "port": port}
        return system.with_values({f"plant.proxy.{name}": value for name, value in values.items()})

    make.fmu = fmu
    return make


def step_until(session, holds):
    for _ in range(10_000):
        if holds():
            return
        assert session.step(1)
    raise AssertionError("it never holds")


@pytest.mark.parametrize("resume", [pytest.param(True, marks=pytest.mark.slow), False])
@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
def test_a_peer_that_is_started_anew(bench, resume, scheme):
    """While it is lost its outputs are as the settings say. Commands after that are a grasp's."""
    with kept_port() as port:
        system = bench(port, resume=resume).with_experiment(scheme=scheme)
        with serving(bench.fmu, LOCKSTEP, ("127.0.0.1", port)):
            session = simulate.session(system, engine=ENGINE)
            session.step(150)
        with session:
            gap = session["plant.gap[1]"]
            session.step(10)
            assert session["plant.proxy.state"] == 3
            assert (session["plant.gap[1]"], session["plant.gap[2]"]) == (gap, 0.25)
            with serving(bench.fmu, LOCKSTEP, ("127.0.0.1", port)) as server:
                session.step(20)
                if resume:
                    step_until(session, lambda: session["plant.proxy.state"] == 1)
                    anew = session.time
                    session.step(150)
                result = session.result()
                counts = server.fmu.counters()
    rows = result.time
    np.testing.assert_allclose(rows, 0.01 * np.arange(len(rows)), atol=1e-12)
    if not resume:
        assert result["plant.proxy.state"][-1] == 3
        assert counts["steps"] == counts["sessions"] == 0
        assert result.initialised_anew == ()
        return
    (begun,) = result.initialised_anew
    assert 1.6 <= begun < anew
    assert f"t = {begun:.9g} s: a lost peer is back: the loop was initialised again" in result.log
    after = rows > begun
    undisturbed = simulate(system.swap("plant", bench.fmu))
    assert largest(result, after) < 1.5 * largest(undisturbed)
    assert result["plant.position[1]"][after][0] == pytest.approx(0.11, abs=1e-3)
    assert counts["steps"] == after.sum()


def test_what_events_have_set_is_set_again_and_slow_components_begin_together(bench):
    """The loop begins anew where all begin a step of their own."""
    with kept_port() as port, serving(bench.fmu, LOCKSTEP, ("127.0.0.1", port)) as server:
        system = bench(port, resume=True, on_loss="hold", timeout=30.0)
        system = system.with_settings({"components.controller.step": 0.04})
        with simulate.session(system, engine=ENGINE) as session:
            whole = session["sensor_1.intensity"]
            session.set("sensor_1.reflectance", 0.5)
            session.step(21)
            server.fmu.peer.trip()
            session.step(1)
            assert session["plant.proxy.state"] == 3
            step_until(session, lambda: session["plant.proxy.state"] == 1)
            (begun,) = session.result().initialised_anew
            assert round(begun / 0.01) % 4 == 0
            session.step(1)
            assert session["sensor_1.intensity"] == pytest.approx(0.5 * whole, rel=0.05)
            result = session.result()
    assert sum("was lost at t = 0.22 s" in line for line in result.log) == 1


def in_real_time(bench, port, **settings):
    system = bench(port, step=1e-3, timeout=5.0, misses_tolerated=1000, **settings)
    return simulate.session(system, engine=ENGINE, realtime=Realtime(stall=0.2))


@pytest.mark.slow
def test_a_stall_ends_a_run_or_begins_the_loop_anew(bench):
    with kept_port() as port, serving(bench.fmu, LOCKSTEP, ("127.0.0.1", port)):
        with in_real_time(bench, port) as session:
            session.step(20)
            time.sleep(0.3)
            with pytest.raises(
                SimulationError, match=r"stalled at t = 0\.02 s: a step would begin"
            ):
                session.step(5)
        with in_real_time(bench, port, resume=True) as session:
            session.step(20)
            time.sleep(0.3)
            session.step(20)
            result = session.result()
    assert result.initialised_anew == (0.02,)
    assert len(result.time) == 41
    assert any("the run stalled for 0.3" in line for line in result.log)


def test_a_burst_of_steps_to_a_bench_is_refused(bench):
    with pytest.raises(InputError, match=r"overrun = 'catch-up': a burst of steps would go to"):
        simulate.session(bench(9), realtime=Realtime(overrun="catch-up"))
