"""A native proxy beside one that Python runs: the same datagrams; its sources; its description."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from random import Random

import pytest
from grasp_fmus import connection
from grasp_fmus.description import Experiment
from grasp_fmus.link.message import END, HELLO, INITIALISE, STEP
from grasp_fmus.native.proxy import proxy_members
from grasp_fmus.native.targets import Version
from grasp_fmus.proxy import DEFAULTS
from grasp_fmus.proxy_build import Original
from support import kinds, scripted_peer
from support.campaign import seeds
from support.fmi2 import Fmu
from support.kinds import Kind
from support.native_proxies import STRICT
from support.scripted_peer import (
    VARIABLES,
    Host,
    ScriptedPeer,
    answer,
    fail,
    forget,
    keep,
    miss,
    send_kept_and_miss,
)
from support.slow import platforms

ACTS = (answer, answer, answer, miss, keep, send_kept_and_miss, forget, fail)
KEY = b"sixteen bytes of key, and some more"


def exchanged(kind: Kind, seed: int, key: Path | None, patch: pytest.MonkeyPatch) -> list[bytes]:
    """All that a proxy sends in a life of many kinds of answers."""
    patch.setattr(scripted_peer, "KIND", kind)
    random = Random(seed)
    with ScriptedPeer(key=key.read_bytes() if key else None) as peer:
        peer.told(HELLO, miss)
        host = Host(
            peer.port, peer.clock, resume=True, misses_tolerated=2, connect_timeout=3600.0,
            key_file=str(key or ""),
        )  # fmt: skip
        host.initialise()
        for _ in range(60):
            host.set(
                force=random.gauss(0.0, 1e3), mode=random.randrange(-(2**31), 2**31),
                armed=random.random() < 0.5, label=random.choice(["", "Größe", "x" * 127]),
                gain=random.uniform(0.5, 2.0),
            )  # fmt: skip
            peer.told(STEP, random.choice(ACTS))
            host.step(random.uniform(1e-6, 1.0))
            peer.clock.now += random.randrange(10**9)
        host.slave.terminate()
    return peer.datagrams


@pytest.mark.parametrize("with_key", [False, True])
@pytest.mark.parametrize(
    "drawn",
    [range(1), pytest.param(seeds(60), marks=[pytest.mark.slow, pytest.mark.campaign])],
    ids=["one", "many"],
)
def test_the_same_datagrams_to_the_byte(
    drawn: range, with_key: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    key = tmp_path / "key" if with_key else None
    if key:
        key.write_bytes(KEY)
        key.chmod(0o600)
    for seed in drawn:
        with monkeypatch.context() as patch:
            theirs = exchanged("native", seed, key, patch)
            found = dict.fromkeys(int.from_bytes(d[24:32], "little") for d in theirs)
            assert {d[6] for d in theirs} == {HELLO, INITIALISE, STEP, END}, seed
            sessions = iter(found)
            patch.setattr(connection, "randbits", lambda bits, known=sessions: next(known))
            assert exchanged("python", seed, key, patch) == theirs, seed


def write_sources(folder: Path, fmi: Version) -> None:
    original = Original('An "original".fmu', VARIABLES, {}, Experiment(), True)
    for file, data in proxy_members(Path("AnyProxy.fmu"), original, fmi, DEFAULTS).items():
        if file.startswith("sources/"):
            (folder / file.removeprefix("sources/")).write_bytes(data)


@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("level", ["-O0", "-O3"])
@pytest.mark.parametrize(
    ("compiler", "libraries"),
    [("gcc", ""), ("clang", ""), platforms("x86_64-w64-mingw32-gcc", "-lws2_32")],
)
def test_the_sources_compile_without_a_warning(
    tmp_path: Path, compiler: str, libraries: str, level: str, fmi: Version
) -> None:
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
@pytest.mark.skipif(not shutil.which("gcc"), reason="NO gcc")
def test_two_of_them_link_into_one_program(tmp_path: Path) -> None:
    """All but the functions of FMI is static, and those have the name of the FMU before them."""
    write_sources(tmp_path, 2)
    text = (tmp_path / "AnyProxy.c").read_text()
    (tmp_path / "Other.c").write_text(text.replace("AnyProxy", "Other"))
    main = "extern int AnyProxy_fmi2Reset(void*), Other_fmi2Reset(void*);\n"
    main += "int main(void) { return AnyProxy_fmi2Reset(0) + Other_fmi2Reset(0); }\n"
    (tmp_path / "main.c").write_text(main)
    files = ["AnyProxy.c", "Other.c", "main.c"]
    command = ["gcc", "-std=c99", *files, "-o", "both", "-lm", "-lpthread", "-ldl"]
    subprocess.run(command, cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "both"])
    assert done.returncode == 6


SLOW_RESOLVER = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <netdb.h>
#include <unistd.h>
int getaddrinfo(const char *host, const char *service, const struct addrinfo *how,
                struct addrinfo **found)
{
    int (*real)(const char *, const char *, const struct addrinfo *, struct addrinfo **);
    *(void **)&real = dlsym(RTLD_NEXT, "getaddrinfo");
    if (!(how->ai_flags & AI_NUMERICHOST))
        sleep(1);
    return real(host, service, how, found);
}
"""
UNLOADED = """
import ctypes, sys, time
import _ctypes
library, guid = ctypes.CDLL(sys.argv[1]), sys.argv[2].encode()
library.fmi2Instantiate.restype = ctypes.c_void_p
callbacks = (ctypes.c_void_p * 5)()
c = ctypes.c_void_p(library.fmi2Instantiate(b"x", 1, guid, b"", callbacks, 0, 0))
assert c
vr, n = (ctypes.c_uint * 1)(int(sys.argv[3])), ctypes.c_size_t(1)
assert library.fmi2SetString(c, vr, n, (ctypes.c_char_p * 1)(b"localhost")) == 0
vr[0] = int(sys.argv[4])
assert library.fmi2SetReal(c, vr, n, (ctypes.c_double * 1)(0.05)) == 0
assert library.fmi2EnterInitializationMode(c) == 3
library.fmi2FreeInstance(c)
_ctypes.dlclose(library._handle)
time.sleep(1.5)
print("lives")
"""


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("gcc"), reason="NO gcc")
def test_the_resolver_may_come_back_when_the_fmu_is_gone(tmp_path: Path) -> None:
    """The thread that was left alone with a name is still in the library, which a host unloads."""
    original = Original("Original.fmu", VARIABLES, {}, Experiment(), True)
    fmu = Fmu(kinds.build_proxy(original, "native", tmp_path, DEFAULTS), tmp_path / "unpacked")
    (tmp_path / "slow.c").write_text(SLOW_RESOLVER)
    shared = ["gcc", "-shared", "-fPIC", "slow.c", "-o", "slow.so", "-ldl"]
    subprocess.run(shared, cwd=tmp_path, check=True)
    places = [str(fmu.references[f"proxy.{name}"]) for name in ("host", "connect_timeout")]
    done = subprocess.run(
        [sys.executable, "-c", UNLOADED, str(fmu.binary), fmu.guid, *places],
        env={**os.environ, "LD_PRELOAD": str(tmp_path / "slow.so")}, capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "lives\n", "")
