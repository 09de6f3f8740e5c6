"""The sources of a proxy, and a proxy in a host by the real clock."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest
from fmpy import simulate_fmu
from grasp_cosim.fmu_export.build import planned
from grasp_cosim.fmu_export.link import END, HELLO, INITIALISE, STEP
from grasp_cosim.fmu_export.proxy import Settings, build_proxy
from support.fmi2 import OK, WARNING, Fmu, Instance
from support.marks import platforms
from support.native_proxies import STRICT, original, write_sources
from support.scripted_peer import ScriptedPeer, fail

pytestmark = pytest.mark.skipif(not shutil.which("gcc"), reason="NO gcc")


@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("level", ["-O0", "-O3"])
@pytest.mark.parametrize(
    ("compiler", "libraries"),
    [("gcc", ""), ("clang", ""), platforms("x86_64-w64-mingw32-gcc", "-lws2_32")],
)
def test_the_sources_compile_without_a_warning(tmp_path, compiler, libraries, level, fmi):
    if not shutil.which(compiler):
        pytest.skip(f"NO {compiler}")
    write_sources(tmp_path, fmi)
    command = [
        compiler, "-std=c99", level, *STRICT, f"-DFMI{fmi}_OVERRIDE_FUNCTION_PREFIX", "-shared",
        "-fPIC", "-o", "proxy.so", "AnyProxy.c", "-lm", *libraries.split(),
    ]  # fmt: skip
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_two_of_them_link_into_one_program(tmp_path):
    """All but the functions of FMI is static, and those have the name of the FMU before them."""
    write_sources(tmp_path)
    text = (tmp_path / "AnyProxy.c").read_text()
    (tmp_path / "Other.c").write_text(text.replace("AnyProxy", "Other"))
    main = "extern int AnyProxy_fmi2Reset(void*), Other_fmi2Reset(void*);\n"
    main += "int main(void) { return AnyProxy_fmi2Reset(0) + Other_fmi2Reset(0); }\n"
    (tmp_path / "main.c").write_text(main)
    command = ["gcc", "-std=c99", "AnyProxy.c", "Other.c", "main.c", "-o", "both", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "both"]).returncode == 6


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """One that was built for users."""
    target = tmp_path_factory.mktemp("proxy") / "TheProxy.fmu"
    return build_proxy(
        target, original(), planned(), Settings(timeout=60.0, connect_timeout=60.0)
    ).path


@pytest.fixture(scope="module")
def fmu(path, tmp_path_factory):
    return Fmu(path, tmp_path_factory.mktemp("unpacked"))


def initialised(instance, port, timeout=60.0):
    reference = (ctypes.c_uint * 1)(instance.fmu.references["proxy.on_loss"])
    text = (ctypes.c_char_p * 1)(b"failsafe")
    assert instance.call("SetString", reference, ctypes.c_size_t(1), text) == OK
    return instance.initialise(**{"proxy.port": port, "proxy.timeout": timeout})


def test_reset_ends_the_session_and_another_begins(fmu):
    with ScriptedPeer() as peer, Instance(fmu, "bench") as instance:
        for _ in range(5):
            initialised(instance, peer.port)
            assert instance.set({"force": 9.0}) == OK
            assert instance.step(0.0, 0.5) == OK
            assert instance.get("doubled") == [18.0]
            assert instance.get("proxy.round_trip_time") > [0.0]
            assert instance.call("Reset") == OK
            assert instance.get("force") == [1.5]
    assert peer.kinds() == [HELLO, INITIALISE, STEP, END] * 5
    assert len({m.session for m in peer.got}) == 5


def test_a_loss_is_a_warning_in_the_log(fmu):
    with ScriptedPeer() as peer, Instance(fmu, "bench") as instance:
        initialised(instance, peer.port)
        peer.told(STEP, fail)
        assert instance.step(0.0, 0.5) == OK
        (said,) = instance.log
        assert (said.status, said.category) == (WARNING, "logStatusWarning")
        assert said.text == (
            f"bench, t = 0 s: 127.0.0.1:{peer.port} is lost: "
            "the peer failed: the motor is hot; proxy.on_loss = failsafe"
        )


def test_a_silent_peer_by_the_real_clock(fmu):
    with ScriptedPeer() as peer, Instance(fmu, "bench") as instance:
        initialised(instance, peer.port, 1e-3)
        peer.told(STEP, *[lambda p, m: None] * 10)
        for k in range(6):
            assert instance.step(0.5 * k, 0.5) == OK
        assert instance.get("proxy.age") == [3.0]
        assert "4 missed in a row: no answer within 0.001 s;" in instance.log[0].text
    assert peer.kinds().count(STEP) == 4


def test_plain_fmpy_simulates_it(path):
    with ScriptedPeer() as peer:
        force = np.array([(0.0, 1.0), (1.0, 2.0)], [("time", "f8"), ("force", "f8")])
        result = simulate_fmu(
            str(path), validate=True, stop_time=1.0, step_size=0.125, output_interval=0.125,
            start_values={"proxy.port": peer.port, "gain": 4.0}, input=force,
            output=["doubled", "passed", "proxy.state", "proxy.missed"],
        )  # fmt: skip
    inputs = [peer.values(m)[0] for m in peer.got if m.kind == STEP]
    assert len(inputs) == 8
    np.testing.assert_array_equal(result["doubled"][1:], [4.0 * force for force in inputs])
    assert [set(result[n]) for n in ("passed", "proxy.state", "proxy.missed")] == [{3}, {1}, {0}]
