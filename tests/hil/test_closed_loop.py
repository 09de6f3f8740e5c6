"""The grasp with parts of it behind proxies: to the bit in lockstep, and over a bad network."""

from contextlib import ExitStack, contextmanager
from itertools import count

import numpy as np
import pytest
from grasp_cosim import simulate
from grasp_cosim.hil.network_conditions import DIRECTIONS, Conditions, Network
from grasp_cosim.hil.served import Service
from support.marks import slow
from support.proxies import ANY_PORT, build_proxy, relaying, serving, wait_until

ENGINE = "python"
"""The peers are threads of this process. The compiled loop keeps Python's lock to itself, where
another FMU is a Python one, and a native proxy in it then waits for a peer that cannot run."""

LOCKSTEP = Service(lockstep=True)
STEPS = 300
SPARE = 20
"""Steps that are left at the end, for a step whose answer is in time."""

CLEAN = 12
"""The datagrams at the beginning, which pass in both directions: HELLO and INITIALISE."""


def proxied(system, name, folder, port):
    """The system with a proxy of a component, whose peer is at a port of this machine."""
    proxy = build_proxy(system.component(name, "test").fmu, folder / f"{name}_bench.fmu", ANY_PORT)
    return system.swap(name, proxy).with_values({f"{name}.proxy.port": port})


@contextmanager
def on_the_bench(system, folder, *names):
    """The system with these components as proxies, each with a peer in lockstep of its own."""
    with ExitStack() as stack:
        for name in names:
            fmu = system.component(name, "test").fmu
            server = stack.enter_context(serving(fmu, LOCKSTEP))
            system = proxied(system, name, folder, server.address[1])
        yield system


def assert_same(direct, benched):
    for signal, column in direct.items():
        np.testing.assert_array_equal(column, benched[signal], signal)


@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
@pytest.mark.parametrize(
    "names",
    [slow(("plant", "sensor_1", "sensor_2", "controller")), ("controller",)],
    ids=["all", "controller"],
)
def test_a_part_on_the_bench_changes_no_bit(grasp, tmp_path, names, scheme):
    """Past the contacts, in steps as long as the grasp takes them."""
    system = grasp.with_experiment(step=4e-3, stop=2.0, scheme=scheme)
    system = system.with_values(
        {"plant.initial_object_position": 0.02, "sensor_1.reflectance": 0.93}
    )
    direct = simulate(system)
    with on_the_bench(system, tmp_path, *names) as benched:
        result = simulate(benched, engine=ENGINE)
    assert_same(direct, result)
    for name in names:
        assert not result[f"{name}.proxy.missed"].any()
        assert set(result[f"{name}.proxy.state"]) == {1}
        assert not result[f"{name}.proxy.age"].any()
    assert None not in direct.metrics["time_to_contact"]


@pytest.mark.slow
def test_native_and_python_mixed(grasp, natives, tmp_path):
    """Proxies of native and of Python FMUs, with peers that serve the other; the bench is used
    a second time.
    """
    system = grasp.with_experiment(step=4e-3, stop=2.0)
    direct = simulate(system)
    for name in ("plant", "sensor_2"):
        system = system.swap(name, natives / system.component(name, "test").fmu.name)
    with on_the_bench(system, tmp_path, "plant", "sensor_1", "controller") as benched:
        for _ in range(2):
            assert_same(direct, simulate(benched, engine=ENGINE))


def test_events_reach_the_bench(grasp, tmp_path):
    """A tunable parameter of a sensor on the bench, set on the way."""
    system = grasp.with_experiment(step=1e-3, stop=0.02)
    found = []
    with on_the_bench(system, tmp_path, "sensor_1") as benched:
        for each in (benched, system):
            with simulate.session(each, engine=ENGINE) as session:
                session.step(10)
                session.set("sensor_1.reflectance", 0.57)
                session.step(10)
                found.append(session.result()["sensor_1.intensity"])
    there, here = found
    np.testing.assert_array_equal(there, here)
    assert here[11] < 0.6 * here[10]


@pytest.fixture
def slow_grasp(grasp):
    return grasp.with_experiment(step=0.01, stop=0.01 * (STEPS + SPARE))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plant", "controller"])
def test_with_losses_and_jitter_the_grasp_completes_and_every_datagram_is_accounted_for(
    slow_grasp, tmp_path, name
):
    """With a seed at which the session begins and ends without a loss.

    Up to a step whose answer is in time: all answers that arrive have come by then.
    """
    conditions = dict.fromkeys(DIRECTIONS, Conditions(jitter=0.002, loss=0.05, duplicate=0.02))
    clean = (*range(1, CLEAN), *range(STEPS - 5, STEPS + SPARE + CLEAN))
    networks = (Network(conditions, seed=seed) for seed in count(1))
    bad = next(
        n for n in networks if all(len(n.fate(d, k)) == 1 for d in DIRECTIONS for k in clean)
    )
    log, values = [], {f"{name}.proxy.timeout": 0.1, f"{name}.proxy.misses_tolerated": 1000}
    with (
        serving(slow_grasp.component(name, "test").fmu, LOCKSTEP) as server,
        relaying(server.address, bad, log=log.append) as relay,
    ):
        benched = proxied(slow_grasp, name, tmp_path, relay.address[1]).with_values(values)
        with simulate.session(benched, engine=ENGINE) as session:
            session.step(STEPS)
            while session[f"{name}.proxy.consecutive_missed"]:
                assert session.step(1)
            result = session.result()
        wait_until(lambda: server.fmu.counters()["sessions"] == 1)
        peer, requests = server.fmu.counters(), relay.counters["request"].received
    dropped = {d: sum(e.direction == d and e.delay is None for e in log) for d in DIRECTIONS}
    copies = {d: sum(e.direction == d and e.copy == 1 for e in log) for d in DIRECTIONS}
    steps, proxy = len(result.time) - 1, result.metrics["proxies"][name]
    assert requests - 1 - steps < CLEAN  # HELLO and INITIALISE, and END
    assert min(dropped.values()) > 0
    assert proxy["missed"] - proxy["late"] == sum(dropped.values())
    assert (proxy["duplicated"], proxy["rejected"]) == (copies["reply"], 0)
    assert peer["duplicated"] + peer["stale"] == copies["request"] + (
        steps - dropped["request"] - peer["steps"]
    )
    for finger, force in ((1, 3.43), (2, -3.43)):
        assert result[f"plant.contact[{finger}]"][-1]
        assert result[f"plant.contact_force[{finger}]"][-1] == pytest.approx(force, rel=0.1)


def test_the_verdict_on_a_triggered_run_is_on_all_of_its_steps(grasp, tmp_path):
    """Its windows have a few of them; the outputs of the peer may be what triggers."""
    system = grasp.with_experiment(step=4e-3, stop=0.4)
    force = simulate(system)["controller.force[1]"]
    above = force > -0.05
    first, second = np.flatnonzero(above & ~np.append(False, above[:-1])).tolist()
    times = {"before": 0.02, "after": 0.04}
    with on_the_bench(system, tmp_path, "controller") as benched:
        triggered = benched.with_record(trigger="controller.force[1] > -0.05", **times)
        result = simulate(triggered, engine=ENGINE)
    start, later = result.windows
    assert start["controller.force[1]"].tolist() == force[first : first + 11].tolist()
    assert later["controller.force[1]"].tolist() == force[second - 5 : second + 11].tolist()
    assert result.metrics["proxies"]["controller"]["lost"] == []
    assert (len(result.verdict), len(start.verdict)) == (8, 0)
    assert result.passed
