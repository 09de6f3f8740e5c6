"""A native proxy on Windows, under wine, and on ARM, under qemu, with `serve` on the loopback."""

import pytest
from grasp_cosim.hil.served import Service
from grasp_fmus.native.targets import LINUX_ARM, WINDOWS
from support.c_host import Script, bits, number, unpacked
from support.fmi2 import Fmu, Instance
from support.marks import needs_zig
from support.platforms import needs_programs
from support.proxies import build_proxy, serving, wait_until

pytestmark = [pytest.mark.platforms, needs_zig]

ON_WINDOWS = needs_programs("wine")
ON_ARM = needs_programs("qemu-aarch64", "aarch64-linux-gnu-gcc")

STEPS, H = 50, 1e-3


@pytest.mark.parametrize(
    ("target", "fmi", "place"),
    [
        pytest.param(WINDOWS, 2, "win64", marks=ON_WINDOWS),
        pytest.param(WINDOWS, 3, WINDOWS.tuple, marks=ON_WINDOWS),
        pytest.param(LINUX_ARM, 3, LINUX_ARM.tuple, marks=ON_ARM),
    ],
)
def test_steps(fmus, host_for, tmp_path, target, fmi, place):  # fmt: skip
    """To the bit what the FMU gives here."""
    original = fmus / "ProximitySensor.fmu"
    script = Script()
    with serving(original, Service(lockstep=True)) as server:
        options = ["--target", target.tuple, "--fmi", str(fmi)]
        path = build_proxy(original, tmp_path / "Bench.fmu", server.address[1], *options)
        fmu = unpacked(path, tmp_path / "unpacked")
        gap, intensity = fmu.reference("gap"), fmu.reference("intensity")
        script.add("load", 0, fmi, f"{'Z:' if target == WINDOWS else ''}{fmu.binary(place)}")
        script.add("new", 0, 0, "full", "bench", fmu.token, None)
        script.add("init", 0, bits(0.0)).add("leave", 0)
        for k in range(STEPS):
            script.add("set", 0, "real", gap, bits(0.01 + 1e-4 * k))
            script.add("step", 0, bits(k * H), bits(H))
            script.add("get", 0, "real", intensity)
        script.add("terminate", 0).add("free", 0)
        (answers,) = host_for(target).run(script, folder=tmp_path)
        wait_until(lambda: server.fmu.counters()["sessions"] == 1)  # the end has no answer
        assert server.fmu.counters()["steps"] == STEPS
    assert [a for a in answers if a.status] == []
    found = [number(a.found[0]) for a in answers if a.command == "get"]
    with Instance(Fmu(original, tmp_path / "here")) as instance:
        instance.initialise()
        for k in range(STEPS):
            instance.set({"gap": 0.01 + 1e-4 * k})
            instance.step(k * H, H)
            assert instance.get("intensity") == [found[k]]


@ON_WINDOWS
def test_a_peer_that_is_gone_on_windows(fmus, host_for, tmp_path):
    original = fmus / "ProximitySensor.fmu"
    with serving(original, Service(lockstep=True)) as server:
        port = server.address[1]
    options = ["--target", "win64"]
    fmu = unpacked(build_proxy(original, tmp_path / "B.fmu", port, *options), tmp_path / "u")
    script = Script().add("load", 0, 2, f"Z:{fmu.binary('win64')}")
    script.add("new", 0, 0, "full", "bench", fmu.token, None)
    script.add("set", 0, "real", fmu.reference("proxy.connect_timeout"), bits(0.2))
    script.add("init", 0, bits(0.0)).add("free", 0)
    (answers,) = host_for(WINDOWS).run(script, folder=tmp_path)
    assert [a.status for a in answers] == [0, 0, 0, 3, 0]
    ((_, _, _, said),) = answers[3].said
    assert f"no answer from 127.0.0.1:{port} within 0.2 s: is the peer running there" in said
