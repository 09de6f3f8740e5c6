"""Proxies in real time: what is said of their peers, and two of them at one port."""

import time

import pytest
from grasp_cosim import InputError, simulate
from grasp_cosim.hil.served import Service
from grasp_cosim.realtime.pacer import Pacer, long_waits
from grasp_cosim.system.parts import Realtime
from support.proxies import ANY_PORT, build_proxy, serving

LOCKSTEP = Service(lockstep=True)


@pytest.fixture
def benched(grasp, tmp_path):
    """Makes the grasp with a component behind a proxy at a port."""

    def make(port, *names, **settings):
        system = grasp.with_experiment(step=1e-3, stop=0.05)
        for name in names:
            fmu = system.component(name, "test").fmu
            system = system.swap(name, build_proxy(fmu, tmp_path / "Bench.fmu", ANY_PORT))
            values = {f"{name}.proxy.{n}": v for n, v in {"port": port, **settings}.items()}
            system = system.with_values(values)
        return system

    return make


def test_a_wait_for_a_peer_that_is_longer_than_a_period_is_said(benched):
    system = benched(9, "sensor_1", timeout=0.002)
    assert long_waits(system, Realtime(factor=0.25)) == []
    (line,) = long_waits(system, Realtime())
    assert line.startswith("sensor_1: proxy.timeout = 0.002 s is longer than the period of 0.001 s")


def test_what_follows_on_an_overrun_is_chosen_by_whether_there_is_a_proxy(benched, grasp):
    paced = grasp.with_experiment(step=1e-3, stop=0.05)
    assert Pacer(paced, Realtime()).realtime.overrun == "catch-up"
    assert Pacer(benched(9, "plant"), Realtime()).realtime.overrun == "continue"


def test_it_is_the_peer_that_is_to_blame(benched, grasp):
    """Its name is that of the component, and whose time it was."""
    fmu = grasp.component("sensor_1", "test").fmu
    with serving(fmu, LOCKSTEP) as server:
        answer = server.fmu.answer

        def slow(*arguments):
            if server.fmu.peer.counters.steps == 20:
                time.sleep(0.05)
            return answer(*arguments)

        server.fmu.answer = slow
        system = benched(server.address[1], "sensor_1", timeout=10.0)
        result = simulate(system, engine="python", realtime=Realtime(stall=60.0))
    assert result.timing.culprits["sensor_1's peer"] >= 1
    assert {"step", "sensor_1"} <= {*result.timing.parts}


def test_two_proxies_at_one_port_are_told_that_the_peer_is_busy(benched, grasp):
    fmu = grasp.component("sensor_1", "test").fmu
    with serving(fmu, LOCKSTEP) as server:
        system = benched(server.address[1], "sensor_1", "sensor_2", connect_timeout=0.5)
        with pytest.raises(InputError, match="the peer is busy with another proxy"):
            simulate(system, engine="python")


def test_a_hand_of_eight_fingers_shakes_hands_in_small_datagrams(grasp, fmus, tmp_path):
    """Its signature is longer than a datagram that no network takes apart."""
    from grasp_cosim.fmu_export.link import LARGEST_HANDSHAKE, Peer
    from grasp_cosim.hil.proxy_of_fmu import exchanged, link_signature
    from support.proxies import HandProxy

    signature, _ = link_signature(exchanged(fmus / "HandPlant.fmu"))
    wide = signature.text.count("\n")
    assert wide > 20
    peer = Peer(signature)
    proxy = HandProxy(signature, lambda datagram: peer.receive(datagram, 0))
    for part in range(len(signature.parts())):
        hello = proxy.hello(1, part=part)
        assert len(hello) <= LARGEST_HANDSHAKE
        assert len(peer.receive(hello, 0)) <= len(hello)
