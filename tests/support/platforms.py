"""Platforms and compilers that native FMUs are tried on: what compiles for them, what runs them."""

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from grasp_cosim.base.c_compilers import LEVEL, Compiler, compile_all
from grasp_cosim.fmu_export.build import compiler_for, job
from grasp_cosim.fmu_export.native.targets import LINUX_ARM, LINUX_X86, WINDOWS, Target, this_target

from .c_host import HEADERS, SOURCE, Host, Part
from .compiled import compile_c
from .fmi2 import Fmu
from .marks import needs_zig, slow

ZIG = ("zig",)
"""Stands for the compiler that build takes for a target."""

ARM_LIBRARIES = Path("/usr/aarch64-linux-gnu")
"""The libc that Debian has for aarch64, in libc6-dev-arm64-cross."""


def needs_programs(*programs):
    missing = [program for program in programs if not shutil.which(program)]
    return pytest.mark.skipif(bool(missing), reason=f"NO {', '.join(missing)}")


@dataclass(frozen=True)
class Platform:
    """A compiler, its options, and the machine it compiles for."""

    name: str
    compiler: tuple[str, ...]
    target: Target = LINUX_X86
    level: str = LEVEL
    same_bits: bool = True
    """Its libm is the one that Python uses."""
    mark: Any = ()

    def compiled(self, fmu, folder):
        """The library of an FMU in a folder, made from its sources alone."""
        library = folder / f"{fmu.name}{self.target.suffix}"
        if self.compiler == ZIG:
            zig = compiler_for(self.target, requested=True)
            sources = {f.name: f.read_bytes() for f in (fmu.folder / "sources").iterdir()}
            (made,) = compile_all([job(fmu.name, sources, self.target, zig)], folder)
            library.write_bytes(made.read_bytes())
            return library
        line = job(fmu.name, {}, self.target, Compiler(self.compiler)).command
        command = [self.level if word == LEVEL else word for word in line]
        done = subprocess.run(
            [*command, "-o", str(library)],
            cwd=fmu.folder / "sources", capture_output=True, text=True,
        )  # fmt: skip
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
        return library


X86 = [
    *(Platform(f"gcc {level}", ("gcc",), level=level, mark=needs_programs("gcc"))
      for level in ("-O0", "-O1", "-O2", "-O3", "-Os")),
    *(Platform(f"clang {level}", ("clang",), level=level, mark=needs_programs("clang"))
      for level in ("-O0", "-O2", "-O3")),
    *(Platform(f"{cc} -march=native", (cc, "-march=native"), level="-O3", mark=needs_programs(cc))
      for cc in ("gcc", "clang")),
    Platform("zig for glibc 2.17", ZIG, mark=needs_zig),
]  # fmt: skip
ARM = [
    Platform("aarch64 gcc", ("aarch64-linux-gnu-gcc",), LINUX_ARM,
             mark=needs_programs("qemu-aarch64", "aarch64-linux-gnu-gcc")),
    Platform("aarch64 gcc -O3", ("aarch64-linux-gnu-gcc",), LINUX_ARM, level="-O3",
             mark=needs_programs("qemu-aarch64", "aarch64-linux-gnu-gcc")),
    Platform("aarch64 zig", ZIG, LINUX_ARM,
             mark=[needs_programs("qemu-aarch64", "aarch64-linux-gnu-gcc"), needs_zig]),
]  # fmt: skip
MINGW = "x86_64-w64-mingw32-gcc"
WIN = [
    Platform(
        "windows zig", ZIG, WINDOWS, same_bits=False, mark=[needs_programs("wine"), needs_zig]
    ),
    Platform(
        "windows mingw", (MINGW,), WINDOWS, same_bits=False, mark=needs_programs("wine", MINGW)
    ),
]


def cases(platforms, versions=(2, 3)):
    """Parameters of a test, each with its marks: a platform and a version of FMI."""
    return [
        pytest.param(p, fmi, id=f"{p.name}, FMI {fmi}", marks=p.mark)
        for p in platforms
        for fmi in versions
    ]


def host_of(target, folder, options=()):
    """The host in C for a platform, compiled into a folder, and what runs it here."""
    strict = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", f"-I{HEADERS}", *options]
    program = folder / ("host.exe" if target == WINDOWS else "host")
    if target == WINDOWS:
        mingw = shutil.which(MINGW)
        command = [mingw] if mingw else [*compiler_for(WINDOWS, requested=True).command]
        subprocess.run([*command, *strict, SOURCE, "-o", program], check=True)
        return Host(program, ("wine",), windows())
    compiler = "gcc" if target == this_target() else "aarch64-linux-gnu-gcc"
    posix = ["-D_POSIX_C_SOURCE=200809L", "-pthread", "-ldl"]
    compile_c([compiler, *strict, SOURCE, *posix], program)
    if target == this_target():
        return Host(program)
    return Host(program, ("qemu-aarch64", "-L", str(ARM_LIBRARIES)))


def windows():
    """The environment of a program that wine runs."""
    return {**os.environ, "WINEPREFIX": str(_wine()), "WINEDEBUG": "-all"}


def _wine():
    """A Windows of the tests, made once: it takes 20 s, and 700 MB beside this Python."""
    folder = Path(sys.prefix, "wine_of_the_tests")
    if not folder.exists():
        with tempfile.TemporaryDirectory(dir=sys.prefix) as name:
            part = Path(name, "wine")
            run_in_wine(["wineboot", "--init"], part)
            run_in_wine(["wineserver", "--wait"], part)
            part.rename(folder)
    return folder


def run_in_wine(command, prefix):
    """Run one of wine's own programs, which say much."""
    more = {
        "WINEPREFIX": str(prefix), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree,mshtml=",
    }  # fmt: skip
    subprocess.run(command, env={**os.environ, **more}, capture_output=True, timeout=300)


Parts = dict[str, Part]
"""By the names of the FMUs."""


@pytest.fixture(scope="session")
def parts_of(folder_of, tmp_path_factory):
    """The native FMUs for a version of FMI, unpacked once per test process."""
    known = {}

    def parts(fmi):
        if fmi not in known:
            folder = folder_of("native" if fmi == 2 else "native FMI 3")
            fmus = [
                Fmu(path, tmp_path_factory.mktemp(path.stem))
                for path in sorted(folder.glob("*.fmu"))
            ]
            known[fmi] = {fmu.name: Part(fmu, fmu.binary) for fmu in fmus}
        return known[fmi]

    return parts


@pytest.fixture(params=[2, slow(3)], ids=["FMI 2", "FMI 3"])
def parts(request, parts_of):
    """The native FMUs, of each version of FMI in turn."""
    return parts_of(request.param)


@pytest.fixture(scope="session")
def host_for(tmp_path_factory):
    """The host for a platform, compiled once per test process."""
    known = {}

    def host(target):
        if target not in known:
            known[target] = host_of(target, tmp_path_factory.mktemp("host"))
        return known[target]

    return host


@pytest.fixture
def host(host_for):
    """The host for this machine."""
    if not shutil.which("gcc"):
        pytest.skip("NO gcc")
    return host_for(this_target())


@pytest.fixture(scope="session")
def parts_on(parts_of, tmp_path_factory):
    """The same FMUs for a platform and a version of FMI, compiled once per test process."""
    known = {}

    def parts(platform, fmi):
        if (platform.name, fmi) not in known:
            folder = tmp_path_factory.mktemp("compiled")
            known[platform.name, fmi] = {
                name: Part(part.fmu, platform.compiled(part.fmu, folder))
                for name, part in parts_of(fmi).items()
            }
        return known[platform.name, fmi]

    return parts
