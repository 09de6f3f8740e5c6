"""An FMU served at its port: real sockets on the loopback."""

import json
import os
import signal
import subprocess
import sys
import zipfile
from contextlib import contextmanager

import pytest
from grasp_cosim import cli
from grasp_cosim.base.errors import InputError
from grasp_cosim.hil.protocol import link_signature
from grasp_cosim.hil.served import ServedFmu, Service
from grasp_cosim.hil.server import Server
from grasp_cosim.interface.read import read_interface
from support.proxies import HandProxy, UdpAsk, serving, wait_until

KEY = b"a key of 16 byte"


@contextmanager
def proxied(fmu, server, key=None):
    signature, _ = link_signature(read_interface(fmu))
    with UdpAsk(server.address) as ask:
        yield HandProxy(signature, ask, key)


def requests(fmu):
    interface = read_interface(fmu)
    signature, _ = link_signature(interface)
    return [
        interface.parse("", v.name, interface.by_name[v.name].start or "", text=True)
        for v in signature.request
    ]


def test_a_session_over_udp(fmus):
    fmu = fmus / "GripperPlant.fmu"
    values = requests(fmu)
    with (
        serving(fmu, Service(lockstep=True, key=KEY)) as server,
        proxied(fmu, server, KEY) as proxy,
    ):
        assert server.address[0] == "127.0.0.1"
        proxy.begin(1, values)
        for k in range(50):
            proxy.step(k * 1e-3, 1e-3, values)
        proxy.end()
        wait_until(lambda: server.fmu.counters()["sessions"] == 1)
    assert server.fmu.counters()["steps"] == 50


def test_by_its_own_clock_it_goes_on_without_requests(fmus):
    fmu = fmus / "GripperPlant.fmu"
    values = requests(fmu)
    with serving(fmu, Service()) as server, proxied(fmu, server) as proxy:
        proxy.begin(1, values)
        proxy.step(0.0, 1e-3, values)
        wait_until(lambda: server.fmu.counters()["own_steps"] >= 20)
        proxy.step(0.02, 1e-3, values)
        assert proxy.outputs_time >= 0.02


def test_the_port_is_one_that_is_free(fmus):
    interface = read_interface(fmus / "ProximitySensor.fmu")
    refused = pytest.raises(InputError, match="cannot listen there: Address already in use")
    with Server(ServedFmu(interface)) as server, refused:
        Server(ServedFmu(interface), server.address)


@pytest.mark.usefixtures("ctrl_c")
def test_the_command_serves_until_it_is_interrupted(fmus):
    command = [sys.executable, "-m", "grasp_cosim", "serve", str(fmus / "ProximitySensor.fmu")]
    process = subprocess.Popen(
        [*command, "--port", "0", "--lockstep", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    try:
        assert process.stderr is not None
        line = process.stderr.readline()
        assert line.startswith("serving ProximitySensor.fmu at 127.0.0.1:")
        port = int(line.rpartition(":")[2].partition(",")[0])
        fmu = fmus / "ProximitySensor.fmu"
        signature, _ = link_signature(read_interface(fmu))
        with UdpAsk(("127.0.0.1", port)) as ask:
            HandProxy(signature, ask).begin(1, requests(fmu))
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 0
    assert json.loads(out)["initialisations"] == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--watchdog", "-1"], "--watchdog = -1.0 s: must be a number greater than 0"),
        (["--failsafe", "gap"], "--failsafe 'gap': must be INPUT=VALUE"),
        (["--failsafe", "gap=wide"], "failsafe gap: gap = 'wide': must be a finite number"),
        (["--key-file", "{short}"], "key of 5 bytes: must have 16 or more"),
        (["--host", "192.0.2.1"], "192.0.2.1:5501: cannot listen there"),
        (["--host", ""], ":5501: no such host; must be an IPv4 address or a name that has one"),
    ],
)
def test_wrong_input_is_one_line(fmus, tmp_path, capsys, arguments, message):
    (tmp_path / "short").write_text("short", encoding="utf-8")
    given = [a.format(short=tmp_path / "short") for a in arguments]
    assert cli.main(["serve", str(fmus / "ProximitySensor.fmu"), *given]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert message in captured.err


def test_an_fmu_that_does_not_load_is_not_offered(fmus, tmp_path, capsys):
    empty = tmp_path / "empty.fmu"
    with zipfile.ZipFile(fmus / "GripperPlant.fmu") as good, zipfile.ZipFile(empty, "w") as file:
        file.writestr("modelDescription.xml", good.read("modelDescription.xml"))
    assert cli.main(["serve", str(empty), "--port", "0"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert f"GripperPlant: {empty} has no binary at all; " in captured.err


@pytest.fixture
def ended(monkeypatch):
    """A server is interrupted as soon as it serves."""
    monkeypatch.setattr(Server, "serve", lambda *_: signal.raise_signal(signal.SIGINT))


@pytest.mark.usefixtures("ended")
def test_an_interrupted_service_says_what_is_left(fmus, capsys):
    fmu = str(fmus / "ProximitySensor.fmu")
    assert cli.main(["serve", fmu, "--port", "0"]) == 0
    assert capsys.readouterr().out == "nothing came\n"
    assert cli.main(["serve", fmu, "--port", "0", "--sessions", "1", "--json"]) == 130
    captured = capsys.readouterr()
    assert json.loads(captured.out)["listening"].startswith("127.0.0.1:")
    assert captured.err.endswith("grasp-cosim: interrupted; 0 of 1 sessions served\n")


@pytest.mark.usefixtures("ended")
@pytest.mark.parametrize(
    ("host", "key", "who"),
    [
        ("localhost", False, "any program here"),
        ("0.0.0.0", False, "whoever can reach it"),
        ("0.0.0.0", True, ""),
    ],
)
def test_it_says_who_may_take_part(fmus, tmp_path, capsys, host, key, who):
    (tmp_path / "key").write_bytes(KEY)
    given = ["--host", host, *(["--key-file", str(tmp_path / "key")] if key else [])]
    command = ["serve", str(fmus / "ProximitySensor.fmu"), "--port", "0"]
    assert cli.main([*command, *given]) == 0
    err = capsys.readouterr().err
    said = f" without a key: {who} may take part, and take over a session that is silent for 1 s; "
    assert err.count(said) == bool(who)
    assert err.count("without a key") == bool(who)
