"""The sources of a native FMU in the hands of compilers: warnings, names, flags."""

import platform
import re
import shutil
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from fmus.native.mass import GUID, NAME, compile_in, write_sources
from support.compiled import compile_c
from support.marks import platforms, slow
from support.native_fmus import needs_gcc

pytestmark = needs_gcc


def compiler(name):
    if not shutil.which(name):
        pytest.skip(f"NO {name}")
    return name


@pytest.mark.parametrize("cc", ["gcc", "clang"])
@pytest.mark.parametrize("level", ["-O0", platforms("-O2"), slow("-O3")])
@pytest.mark.parametrize("fmi", [2, 3])
def test_no_warning(cc, level, fmi, tmp_path):
    """Also where the formats of messages are checked."""
    write_sources(tmp_path / "c", fmi)
    checked = "-DTEXT_LIKE_PRINTF=__attribute__((format(printf, 2, 3)))"
    compile_in(tmp_path / "c", fmi, [level, checked], compiler(cc))


@pytest.mark.skipif(not shutil.which("nm"), reason="NO nm")
@pytest.mark.parametrize("fmi", [2, slow(3)])
@pytest.mark.parametrize(
    ("define", "prefix"),
    [
        ((), f"{NAME}_"),
        (("-DFMI{}_FUNCTION_PREFIX=Mine_",), "Mine_"),
        (("-DFMI{}_FUNCTION_PREFIX=",), ""),  # FMPy on Windows
        (("-DFMI{}_OVERRIDE_FUNCTION_PREFIX",), ""),  # the standard's way
        ((f"-D{NAME}_EXPORTS",), ""),  # CMake's, and so FMPy's elsewhere
    ],
)
def test_names_of_functions(define, prefix, fmi, tmp_path):
    """All else is static: any number of FMUs link into one program."""
    write_sources(tmp_path / "c", fmi)
    defined = [text.format(fmi) for text in define]
    source = tmp_path / "c" / f"{NAME}.c"
    command = ["gcc", "-std=c99", "-O0", "-fPIC", "-shared", *defined]
    library = compile_c([*command, source, "-lm"], tmp_path / "found.so")
    done = subprocess.run(["nm", "-D", library], capture_output=True, text=True, check=True)
    names = set(re.findall(r" [TDB] (\w+)", done.stdout))
    assert len(names) == {2: 44, 3: 75}[fmi]
    assert all(name.startswith(f"{prefix}fmi{fmi}") for name in names)


SCRIPT = f"""
import ctypes, sys
text = ctypes.c_char_p
kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, text, ctypes.c_int, text, text)
log = kind(lambda *message: print(message[-1].decode()))
callbacks = (ctypes.c_void_p * 5)(ctypes.cast(log, ctypes.c_void_p))
instantiate = ctypes.CDLL(sys.argv[1]).fmi2Instantiate
instantiate.restype = ctypes.c_void_p
print(bool(instantiate(b"one", 1, {GUID.encode()!r}, None, callbacks, 0, 0)))
"""


def said_of(library):
    """Why a library makes no instance, in a process of its own; None where it makes one."""
    command = [sys.executable, "-c", SCRIPT, str(library)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    *said, lives = done.stdout.splitlines()
    assert len(said) == (lives == "False")
    return said[0] if said else None


FAST = "infinity, NaN, -0.0 and sums are not those of IEEE 754: must be compiled without"
FUSED = "a * b + c is not rounded twice: must be compiled with -ffp-contract=off"
SMALL = "numbers below 2.3e-308 become 0: must be compiled and linked without -ffast-math"
EXACT = "-ffp-contract=off"
CPU = Path("/proc/cpuinfo")


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() != "x86_64", reason="NO x86-64")
@pytest.mark.parametrize("cc", ["gcc", platforms("clang")])
@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ([EXACT, "-march=native", "-O3"], None),
        (["-ffp-contract=fast", "-march=native"], FUSED),
        ([EXACT, "-ffinite-math-only"], FAST),
        ([EXACT, "-fno-signed-zeros"], FAST),
        ([EXACT, "-fassociative-math", "-fno-signed-zeros", "-fno-trapping-math"], FAST),
        (["-Ofast"], FAST),
    ],
)
def test_a_compiler_that_calculates_otherwise_makes_no_instance(cc, options, reason, tmp_path):
    if "-march=native" in options and not (CPU.is_file() and " fma " in CPU.read_text()):
        pytest.skip("NO fused multiply-add in this processor")
    write_sources(tmp_path / "c")
    plain = ["-std=c99", "-O2", "-fPIC", "-shared", "-DFMI2_OVERRIDE_FUNCTION_PREFIX"]
    command = [compiler(cc), *plain, *options, f"{NAME}.c", "-o", "fast.so", "-lm"]
    subprocess.run(command, cwd=tmp_path / "c", check=True)
    said = said_of(tmp_path / "c" / "fast.so")
    assert said is None if reason is None else str(said).startswith(f"one, t = 0 s: {reason}")


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() != "x86_64", reason="NO x86-64")
def test_a_processor_that_drops_small_numbers_makes_no_instance(tmp_path):
    """As a library that is linked with -ffast-math leaves it in the thread that loads it."""
    write_sources(tmp_path / "c")
    library = compile_in(tmp_path / "c")
    (tmp_path / "c" / "empty.c").write_text("int nothing;\n", "utf-8")
    plain = ["-fPIC", "-shared", "empty.c", "-L.", f"-l:{library.name}", "-Wl,-rpath,$ORIGIN"]
    command = ["gcc", "-Ofast", "-Wl,--no-as-needed", *plain, "-o", "over.so"]
    subprocess.run(command, cwd=tmp_path / "c", check=True, capture_output=True)
    assert SMALL in str(said_of(tmp_path / "c" / "over.so"))


FOLDER = Path(__file__).parents[3] / "fmus/grasp_fmus/native/c"
HEADERS = {file.name: file.read_text("utf-8") for file in FOLDER.glob("*.h")}
INCLUDES = {
    name: [other for other in re.findall(r'#include "(.+)"', text) if other in HEADERS]
    for name, text in HEADERS.items()
}
COMPILER = ("gcc", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wno-unused-function")


def lacks(name):
    """Whether a header, or one of those that it includes, says what must stand before it."""
    says = re.search(r"\bincluded\b", HEADERS[name].partition("*/")[0])
    return bool(says) or any(map(lacks, INCLUDES[name]))


def test_no_headers_include_each_other_in_a_circle():
    assert "slave.h" in INCLUDES["block_slave.h"]
    TopologicalSorter(INCLUDES).prepare()  # CycleError where there is one


@needs_gcc
@pytest.mark.parametrize("name", sorted(HEADERS))
def test_a_header_compiles_by_itself_or_says_what_it_lacks(name):
    options = ["-D_POSIX_C_SOURCE=200809L", f"-I{FOLDER / 'headers'}", "-fsyntax-only"]
    source = f'#include "{FOLDER / name}"\n'
    done = subprocess.run(
        [*COMPILER, *options, "-x", "c", "-"], input=source, text=True, stderr=subprocess.PIPE
    )
    assert (done.stderr != "") == lacks(name), done.stderr
