"""Over IPv6 from end to end: proxy, relay, server, and the addresses of their commands."""

import socket

import numpy as np
import pytest
from grasp_cosim import simulate
from grasp_cosim.base.errors import InputError
from grasp_cosim.hil.served import Service
from grasp_cosim.hil.sockets import _address, is_loopback, read_address, resolved, text
from support.proxies import ANY_PORT, build_proxy, relaying, serving


def has_ipv6():
    try:
        with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as tried:
            tried.bind(("::1", 0))
    except OSError:
        return False
    return True


needs_ipv6 = pytest.mark.skipif(not has_ipv6(), reason="NO IPv6 on the loopback")


@pytest.mark.parametrize(
    ("given", "address"),
    [
        ("5501", ("127.0.0.1", 5501)),
        ("bench:1", ("bench", 1)),
        ("[::1]:5501", ("[::1]", 5501)),
        ("[fe80::1%eth0]:2", ("[fe80::1%eth0]", 2)),
    ],
)
def test_addresses_as_texts(given, address):
    assert read_address("TO", given) == address
    assert text(read_address("TO", given)) in (given, f"127.0.0.1:{given}")


@pytest.mark.parametrize("given", ["::1", "::1:5501", "[::1]", "a:b:1"])
def test_texts_that_are_no_addresses(given):
    with pytest.raises(InputError, match=r"as in 127\.0\.0\.1:5501 or \[::1\]:5501, or PORT"):
        read_address("TO", given)


def test_numbers_with_brackets_and_without():
    assert resolved("[::1]", 1) == resolved("::1", 1) == ("::1", 1)
    assert text(("::1", 1)) == "[::1]:1"
    assert [is_loopback((h, 1)) for h in ("::1", "fe80::1%lo", "::", "127.0.0.2")] == [
        True, False, False, True,
    ]  # fmt: skip


def test_an_address_on_this_link_keeps_its_interface():
    """As the system tells it of a socket, or of who sent a datagram."""
    assert _address(("fe80::1%eth0", 5501, 0, 2)) == ("fe80::1%2", 5501)
    assert _address(("fe80::1", 5501, 0, 2)) == ("fe80::1%2", 5501)
    assert _address(("::1", 5501, 0, 0)) == ("::1", 5501)
    assert _address(("127.0.0.1", 5501)) == ("127.0.0.1", 5501)


@needs_ipv6
def test_the_loop_over_ipv6_has_the_same_bits(grasp, tmp_path):
    fmu = grasp.component("sensor_1", "test").fmu
    system = grasp.with_experiment(step=4e-3, stop=0.4)
    proxy = build_proxy(fmu, tmp_path / "Bench.fmu", ANY_PORT)
    with (
        serving(fmu, Service(lockstep=True), ("::1", 0)) as server,
        relaying(server.address, host="::1") as relay,
    ):
        values = {"sensor_1.proxy.host": "::1", "sensor_1.proxy.port": relay.address[1]}
        benched = system.swap("sensor_1", proxy).with_values(values)
        result = simulate(benched, engine="python")
        assert text(relay.address).startswith("[::1]:")
        assert relay.counters["reply"].delivered > 100
    expected = simulate(system)
    np.testing.assert_array_equal(result["controller.force[1]"], expected["controller.force[1]"])
