"""The grasp over a network that loses, delays, repeats and swaps; the peer lost, and back again."""

from contextlib import contextmanager
from itertools import count

import numpy as np
import pytest
from grasp_cosim import simulate
from grasp_cosim.hil.network import DIRECTIONS, Conditions, Network, Outage
from grasp_cosim.hil.served import Service
from support.marks import slow
from support.ports import kept_port
from support.proxies import ANY_PORT, build_proxy, relaying, serving, wait_until

ENGINE = "python"
"""The peers are threads of this process: test_closed_loop.py."""

STEP = 0.01
STEPS = 300
SPARE = 20
"""Steps that are left at the end, for a step whose answer is in time."""

CLEAN = 12
"""The datagrams at the beginning, which pass in both directions: HELLO and INITIALISE."""

BAD = Conditions(jitter=0.002, loss=0.05, duplicate=0.02)


def network(conditions, *outages):
    """With a seed at which the session begins and ends without a loss."""
    both = dict.fromkeys(DIRECTIONS, conditions)
    for seed in count(1):
        found = Network(both, outages, seed=seed)
        clean = (*range(1, CLEAN), *range(STEPS - 5, STEPS + SPARE + CLEAN))
        if all(len(found.fate(d, n)) == 1 for d in DIRECTIONS for n in clean):
            return found
    raise AssertionError


@contextmanager
def behind_a_relay(system, name, folder, bad, log):
    """The system with a component on the bench, which steps on request, behind a relay."""
    fmu = system.component(name, "test").fmu
    with (
        serving(fmu, Service(lockstep=True)) as server,
        relaying(server.address, bad, log=log.append) as relay,
    ):
        proxy = build_proxy(fmu, folder / f"{name}_bench.fmu", ANY_PORT)
        port = {f"{name}.proxy.port": relay.address[1]}
        yield system.swap(name, proxy).with_values(port), server, relay


@pytest.fixture(scope="module")
def slow_grasp(grasp):
    return grasp.with_experiment(step=STEP, stop=STEP * (STEPS + SPARE))


def simulated(system, name):
    """Up to a step whose answer is in time: all answers that arrive have come by then."""
    with simulate.session(system, engine=ENGINE) as session:
        session.step(STEPS)
        while session[f"{name}.proxy.consecutive_missed"]:
            assert session.step(1)
        return session.result()


def dropped(log, direction):
    return sum(e.direction == direction and e.delay is None for e in log)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plant", "controller"])
def test_with_losses_and_jitter_the_grasp_completes_and_every_datagram_is_accounted_for(
    slow_grasp, tmp_path, name
):
    log = []
    values = {
        f"{name}.proxy.timeout": 0.1,
        f"{name}.proxy.misses_tolerated": 1000,
    }
    bad = network(BAD)
    with behind_a_relay(slow_grasp, name, tmp_path, bad, log) as (system, server, relay):
        result = simulated(system.with_values(values), name)
        wait_until(lambda: server.fmu.counters()["sessions"] == 1)
        peer, counters = server.fmu.counters(), relay.counters
    steps = len(result.time) - 1
    assert counters["request"].received - 1 - steps < CLEAN  # HELLO and INITIALISE, and END

    def copies(direction):
        return sum(e.direction == direction and e.copy == 1 for e in log)

    requests_lost, replies_lost = (dropped(log, direction) for direction in DIRECTIONS)
    assert requests_lost > 0
    assert replies_lost > 0
    missed, late = last(result, f"{name}.proxy.missed"), last(result, f"{name}.proxy.late")
    assert missed - late == requests_lost + replies_lost
    assert last(result, f"{name}.proxy.duplicated") == copies("reply")
    assert last(result, f"{name}.proxy.rejected") == 0
    assert peer["duplicated"] + peer["stale"] == copies("request") + (
        steps - requests_lost - peer["steps"]
    )
    assert result["plant.contact[1]"][-1]
    assert result["plant.contact[2]"][-1]
    assert result["plant.contact_force[1]"][-1] == pytest.approx(3.43, rel=0.1)
    assert result["plant.contact_force[2]"][-1] == pytest.approx(-3.43, rel=0.1)


def last(result, name):
    return int(result[name][-1])


@pytest.mark.slow
def test_the_peer_out_of_reach_for_a_while_and_back(slow_grasp, tmp_path):
    """Twenty requests get nowhere; the peer makes up for them with what comes after."""
    log = []
    gone = Network(outages=(Outage(100, 120),))
    values = {
        "plant.proxy.timeout": 0.1,
        "plant.proxy.on_loss": "hold",
        "plant.proxy.resume": True,
    }
    with behind_a_relay(slow_grasp, "plant", tmp_path, gone, log) as (system, _, _):
        result = simulated(system.with_values(values), "plant")
    state, row = result["plant.proxy.state"], result["plant.proxy.consecutive_missed"]
    lost = np.flatnonzero(state == 3)
    assert len(lost) >= 17  # of the 20 the first three are tolerated
    assert row[lost[0]] == 4
    assert list(state[lost[0] - 4 : lost[0] + 1]) == [1, 2, 2, 2, 3]
    position, late = result["plant.position[1]"], result["plant.proxy.late"]
    kept = np.flatnonzero((row > 0) & (np.diff(late, prepend=0) == 0))  # a late answer is taken
    assert (position[kept] == position[kept - 1]).all()
    assert state[-1] == 1
    assert result["plant.contact[1]"][-1]
    # An answer that is late by a busy machine may fall into the outage as well
    assert dropped(log, "request") == 20
    missed = last(result, "plant.proxy.missed")
    assert missed - last(result, "plant.proxy.late") == 20 + dropped(log, "reply")


@pytest.mark.parametrize("resume", [slow(True), False])
def test_the_peer_started_anew(slow_grasp, tmp_path, resume):
    """It knows no session; a proxy that may resume begins another one, from the start values."""
    fmu = slow_grasp.component("plant", "test").fmu
    values = {
        "plant.proxy.timeout": 0.05,
        "plant.proxy.misses_tolerated": 2,
        "plant.proxy.on_loss": "failsafe",
        "plant.proxy.hold.gap[1]": True,
        "plant.proxy.failsafe.gap[2]": 0.25,
        "plant.proxy.resume": resume,
    }
    with kept_port() as port:
        proxy = build_proxy(fmu, tmp_path / "plant_bench.fmu", ANY_PORT)
        system = slow_grasp.swap("plant", proxy).with_values({**values, "plant.proxy.port": port})
        with serving(fmu, Service(lockstep=True), ("127.0.0.1", port)):
            session = simulate.session(system, engine=ENGINE)
            session.step(20)
        with session:
            gap = session["plant.gap[1]"]
            session.step(10)
            assert session["plant.proxy.state"] == 3
            assert (session["plant.gap[1]"], session["plant.gap[2]"]) == (gap, 0.25)
            with serving(fmu, Service(lockstep=True), ("127.0.0.1", port)):
                session.step(5)
                while resume and session["plant.proxy.state"] != 1:  # as a busy machine has it
                    assert session.step(1)
            result = session.result()
    assert result["plant.proxy.state"][-1] == (1 if resume else 3)
    assert (result["plant.gap[2]"][-1] == 0.25) != resume
    sessions = result.metrics["proxies"]["plant"]["sessions"]
    assert sessions >= 2 if resume else sessions == 1
    assert any("plant: the peer was lost at t = " in line for line in result.log)
    assert any("started anew" in line for line in result.log) == resume
