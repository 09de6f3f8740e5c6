"""Compilers: found or named as missing, heard when they fail, ended with us, asked once."""

import ctypes
import os
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path

import pytest
from grasp_cosim.base import c_compilers
from grasp_cosim.base.c_compilers import (
    Compiler,
    CompilerError,
    Job,
    cache,
    compile_all,
    find_compiler,
)
from grasp_cosim.fmu_export.build import compiler_for, job
from grasp_cosim.fmu_export.native.targets import LINUX_ARM, LINUX_X86, MAC_ARM, MAC_X86
from support.marks import needs_zig
from support.native_fmus import needs_gcc
from support.processes import ends

SOURCES = {
    "Sum.c": b'#include "terms.h"\nint sum(void) { return hidden(); }\n',
    "terms.h": b"static int hidden(void) { return 40 + 2; }\n",
}
CHANGED = {**SOURCES, "terms.h": SOURCES["terms.h"].replace(b"2", b"3")}

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="NO Linux")


@pytest.fixture(autouse=True)
def _own_cache(request, tmp_path, monkeypatch):
    """An empty one, but for zig, which would make its libraries anew."""
    if "zig_" not in request.node.name:
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("CC", raising=False)


def program(path, text):
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return Compiler((str(path),))


def made(scratch, sources=SOURCES, compiler=None):
    (library,) = compile_all([Job("Sum", sources, compiler or find_compiler())], scratch)
    return library


@needs_gcc
def test_what_is_compiled_is_kept_until_something_differs(tmp_path, monkeypatch):
    log = tmp_path / "log"
    counting = program(tmp_path / "counting", f'echo >> {log}\nexec gcc "$@"')
    other = Compiler((*counting.command, "-O1"))
    runs = []
    for sources, cc in ((SOURCES, counting), (SOURCES, counting), (CHANGED, counting),
                        (SOURCES, counting), (SOURCES, other), (CHANGED, counting)):  # fmt: skip
        library = made(tmp_path, sources, cc)
        runs.append(len(log.read_text().splitlines()))
        assert library.is_relative_to(tmp_path / "cache/grasp-cosim/compiled")
    assert runs == [1, 1, 2, 2, 3, 3]
    assert ctypes.CDLL(str(library)).sum() == 43
    os.utime(tmp_path / "counting", ns=(1, 1))  # as after an update
    made(tmp_path, CHANGED, counting)
    assert len(log.read_text().splitlines()) == 4
    assert not [path for path in library.parent.iterdir() if path.suffix != ".so"]


@needs_gcc
def test_a_cache_that_cannot_be_written_to_is_read(tmp_path, monkeypatch):
    before = made(tmp_path)
    monkeypatch.setattr(cache, "writable", lambda _: None)
    assert made(tmp_path) == before
    library = made(tmp_path, CHANGED)
    assert not library.is_relative_to(tmp_path / "cache")
    assert ctypes.CDLL(str(library)).sum() == 43


def test_no_two_lists_of_parts_have_one_key():
    lists = [["ab", "c"], ["a", "bc"], ["abc"], ["abc", ""], [b"2\0ab"]]
    assert len({cache.key(parts) for parts in lists}) == len(lists)


@pytest.mark.parametrize("given", ["cc 'half a quote", "   ", "no-such-compiler -m64"])
def test_a_compiler_that_is_none_is_named(given, monkeypatch):
    monkeypatch.setenv("CC", given)
    with pytest.raises(ValueError, match=rf"^CC={given}: no such program; must be a C compiler"):
        find_compiler()


def test_cc_comes_first_then_what_there_is(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(c_compilers, "find_zig", lambda: None)
    fix = f"{sys.executable} -m pip install ziglang"
    with pytest.raises(ValueError, match=r"^no C compiler: must be one of CC, cc, ") as error:
        find_compiler()
    assert str(error.value).endswith(fix)
    with pytest.raises(ValueError, match=f"^no C compiler for wasm32-wasi: must be zig; {fix}$"):
        find_compiler("wasm32-wasi")
    monkeypatch.setattr(c_compilers, "find_zig", lambda: Compiler(("/zig", "cc")))
    assert find_compiler().command == ("/zig", "cc")
    assert find_compiler("wasm32-wasi").command == ("/zig", "cc", "-target", "wasm32-wasi", "-s")
    for name in ("clang", "gcc", "cc"):
        program(tmp_path / name, "exit 0")
        assert find_compiler().command == (name,)
    monkeypatch.setenv("CC", "clang 'of mine'")
    assert find_compiler().command == ("clang", "of mine")


ERROR = "M.c:3:1: error: expected ';'"


@pytest.mark.parametrize(
    ("said", "code", "line"),
    [
        (f"In file x:\n{ERROR}\nerror: 2 more", 1, f"exit code 1: {ERROR}"),
        ("cannot go on", 7, "exit code 7: cannot go on"),
        ("", 0, "exit code 0: no message"),
        (None, 0, "No such file or directory"),
    ],
)
def test_a_compiler_that_fails_is_heard_in_one_line(said, code, line, tmp_path):
    compiler = program(tmp_path / "cc", f"printf '%s' \"{said}\" >&2\nexit {code}")
    if said is None:
        (tmp_path / "cc").write_text("#!/no/such/shell\n")
    with pytest.raises(CompilerError) as error:
        made(tmp_path, compiler=compiler)
    assert str(error.value) == f"Sum.c: {tmp_path}/cc: {line}"
    assert not (tmp_path / "cache/grasp-cosim/compiled").exists()


ZIG = """\
for word; do case $word in *.c) name=${{word%.c}};; esac; done
echo "begin $name" >> {log}
sleep {took}
touch $name.so
echo "end $name" >> {log}
"""


def test_the_first_library_that_zig_makes_for_a_target_goes_ahead(tmp_path, monkeypatch):
    """The next would wait for it, with a processor; what is for another target does not wait."""
    log = tmp_path / "log"
    zigs = {}
    for target, took in (("Windows", 0.1), ("Linux", 0.01)):
        (tmp_path / target).mkdir()
        zigs[target] = program(tmp_path / target / "zig", ZIG.format(log=log, took=took))
    monkeypatch.setattr(c_compilers, "_processors", lambda: 2)
    names = [f"{target}{number}" for number in range(3) for target in zigs]
    jobs = [Job(n, {f"{n}.c": n.encode()}, zigs[n[:-1]]) for n in names]
    assert [path.suffix for path in compile_all(jobs, tmp_path)] == [".so"] * len(jobs)
    lines = log.read_text().splitlines()
    assert lines.index("end Windows0") < lines.index("begin Windows1")
    assert lines.index("begin Linux1") < lines.index("begin Windows1")
    assert {line.split()[1] for line in lines} == {*names}


def test_an_interrupt_while_a_compiler_is_started_ends_it(tmp_path, monkeypatch):
    """It comes when the process is there, and nobody has been told of it yet."""
    started, real = [], subprocess.Popen

    def popen(*arguments, **keywords):
        started.append(real(*arguments, **keywords))
        signal.raise_signal(signal.SIGINT)
        return started[0]

    compiler = program(tmp_path / "cc", "exec sleep 3600")
    monkeypatch.setattr(subprocess, "Popen", popen)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            made(tmp_path, compiler=compiler)
    finally:
        signal.signal(signal.SIGINT, before)
    assert started[0].wait(20.0) == -signal.SIGKILL


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_no_compiler_outlives_us(number, code, tmp_path):
    """Nor what it has started, nor its files; those that wait do not start."""
    log = tmp_path / "log"
    program(tmp_path / "cc", f"sleep 3600 & echo $! >> {log}; wait")
    environment = {"CC": f"{tmp_path}/cc", "TMPDIR": str(tmp_path)}
    us = subprocess.Popen(
        [sys.executable, "-m", "grasp_cosim", "build", "--native", "--out", "out"],
        cwd=tmp_path, env={**os.environ, **environment, "PYTHONPATH": os.pathsep.join(sys.path)},
        stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    end = time.monotonic() + 60.0
    while not (log.exists() and log.read_text()) and time.monotonic() < end:
        time.sleep(0.05)
    us.send_signal(number)
    _, said = us.communicate(timeout=60.0)
    assert (us.returncode, said.strip()) == (code, "grasp-cosim: interrupted")
    started = log.read_text().split()
    assert len(started) <= (os.cpu_count() or 1)
    assert all(ends(int(pid)) for pid in started)
    assert not (tmp_path / "out").exists()
    assert not list(tmp_path.glob("grasp_*"))


@needs_zig
@pytest.mark.platforms
@pytest.mark.parametrize("target", [LINUX_X86, LINUX_ARM, MAC_X86, MAC_ARM])
def test_zig_compiles_for_others(target, tmp_path):
    magic = b"\x7fELF" if target.suffix == ".so" else struct.pack("<I", 0xFEEDFACF)
    task = job("Sum", SOURCES, target, compiler_for(target, requested=True))
    assert compile_all([task], tmp_path)[0].read_bytes()[:4] == magic


@pytest.mark.parametrize(
    ("system", "place"),
    [("linux", ".cache"), ("win32", "AppData/Local"), ("darwin", "Library/Caches")],
)
def test_what_is_kept_is_where_the_system_has_caches(monkeypatch, tmp_path, system, place):
    monkeypatch.setattr("sys.platform", system)
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache.folder() == tmp_path / place / "grasp-cosim"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "own"))
    assert cache.folder() == tmp_path / "own" / "grasp-cosim"
