"""What each binary of a native FMU asks of its system: libraries, versions, functions."""

import re
import shutil
import struct
import subprocess
from pathlib import Path

import fmpy
import pytest
from c_compilers import LIBM
from grasp_fmus.build import build_native, planned
from grasp_fmus.native.targets import KNOWN, LINUX_ARM, LINUX_X86, MAC_ARM, MAC_X86, WINDOWS
from support.fmi2 import read_members
from support.marks import needs_zig

NAME = "ProximitySensor"
"""Of all blocks the one that calls most."""

FUNCTIONS = {
    *LIBM, "ceil", "copysign", "fabs", "floor", "sqrt",
    "memcmp", "memcpy", "memmove", "memset",
    "strcat", "strchr", "strcmp", "strcpy", "strcspn", "strlen", "strncmp",
    "calloc", "free", "malloc",
}  # fmt: skip
"""No file, no time, no environment, no output: mathematics, bytes, and memory of the start."""

OF_THE_LINKER = {
    "_ITM_deregisterTMCloneTable",
    "_ITM_registerTMCloneTable",
    "__gmon_start__",
    "__cxa_finalize",
}
IN_WINDOWS = re.compile(r"KERNEL32\.dll|ntdll\.dll|api-ms-win-crt-[a-z]+-l1-1-0\.dll")
"""Parts of every Windows since 10."""

pytestmark = [
    needs_zig,
    pytest.mark.platforms,
    pytest.mark.skipif(not shutil.which("objdump"), reason="NO objdump"),
]


@pytest.fixture(scope="module")
def binaries(tmp_path_factory):
    """One FMU for all platforms, its binaries by target."""
    folder = tmp_path_factory.mktemp("all")
    (built,) = build_native(folder, planned(KNOWN, fmi=3), [NAME])
    members = read_members(built.path)
    files = {}
    for target in KNOWN:
        files[target] = folder / f"{target.tuple}{target.suffix}"
        place = f"binaries/{target.tuple}/{NAME}{target.suffix}"
        files[target].write_bytes(members[place])
    assert {n for n in members if n.startswith("binaries/")} == {
        f"binaries/{t.tuple}/{NAME}{t.suffix}" for t in KNOWN
    }
    return files


def said(*command):
    return subprocess.check_output([str(word) for word in command], text=True)


@pytest.mark.parametrize("target", [LINUX_X86, LINUX_ARM])
def test_on_linux(binaries, target):
    dynamic = said("readelf", "--wide", "--dynamic", binaries[target])
    assert {*re.findall(r"NEEDED.*\[(.*)\]", dynamic)} <= {"libc.so.6", "libm.so.6"}
    symbols = said("readelf", "--wide", "--dyn-syms", binaries[target])
    asked = {*re.findall(r" UND (\w+)", symbols)} - OF_THE_LINKER
    assert asked
    assert asked <= FUNCTIONS
    versions = [tuple(map(int, v.split("."))) for v in re.findall(r"GLIBC_([\d.]+)", symbols)]
    assert max(versions) <= (2, 17)
    assert {*re.findall(r" (?:DEFAULT|PROTECTED) +\d+ (\w+)", symbols)} == standard_functions(3)


def test_on_windows(binaries):
    text = said("objdump", "-p", binaries[WINDOWS])
    libraries = re.findall(r"DLL Name: (\S+)", text)
    assert libraries
    assert [name for name in libraries if not IN_WINDOWS.fullmatch(name)] == []
    exported = {*re.findall(r"^\s+\[ *\d+\] (?:\+base\[ *\d+\] +[0-9a-f]+ )?(fmi\w+)$", text, re.M)}
    assert exported == standard_functions(3)


@pytest.mark.parametrize("target", [MAC_X86, MAC_ARM])
def test_on_macos(binaries, target):
    assert [*loaded_by_mach_o(binaries[target].read_bytes())] == ["/usr/lib/libSystem.B.dylib"]


def loaded_by_mach_o(data):
    """The libraries that it names in commands of the kind LC_LOAD_DYLIB."""
    magic, _, _, _, count = struct.unpack_from("<5I", data)
    assert magic == 0xFEEDFACF
    place = 32
    for _ in range(count):
        kind, size = struct.unpack_from("<II", data, place)
        if kind == 0xC:
            (at,) = struct.unpack_from("<I", data, place + 8)
            yield data[place + at : place + size].split(b"\0")[0].decode()
        place += size


def standard_functions(fmi):
    """Those that the standard's header declares."""
    headers = Path(fmpy.__file__).parent / "c-code"
    text = (headers / f"fmi{fmi}FunctionTypes.h").read_text()
    return {*re.findall(rf"\b(fmi{fmi}\w+)TYPE\b", text)}


def test_one_dylib_serves_both_processors_in_fmi_2(tmp_path):
    (built,) = build_native(tmp_path, planned([MAC_X86, MAC_ARM]), [NAME])
    data = read_members(built.path)[f"binaries/darwin64/{NAME}.dylib"]
    magic, count = struct.unpack_from(">II", data)
    assert (magic, count) == (0xCAFEBABE, 2)
    for i in range(2):
        _, _, place, size, _ = struct.unpack_from(">5I", data, 8 + 20 * i)
        assert [*loaded_by_mach_o(data[place : place + size])] == ["/usr/lib/libSystem.B.dylib"]
