"""The sources of a native FMU in the hands of compilers: warnings, names, flags, checkers."""

import ctypes
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from ctypes import c_char_p, c_int, c_void_p
from pathlib import Path
from typing import Literal

import pytest
from support.compiled import compile_c
from support.fmi2 import ERROR, OK, Fmu, Instance
from support.hand_written import GUID, NAME, STRICT, compile_in, native_fmu, write_sources
from support.native_fmus import needs_gcc
from support.slow import platforms, slow

pytestmark = needs_gcc

COMPILERS = ("gcc", "clang")
VERSIONS: tuple[Literal[2, 3], ...] = (2, 3)
LINK = Path(__file__).with_name("link_two.c")


def compiler(name: str) -> str:
    if not shutil.which(name):
        pytest.skip(f"NO {name}")
    return name


@pytest.mark.parametrize("cc", COMPILERS)
@pytest.mark.parametrize("level", ["-O0", platforms("-O2"), slow("-O3")])
def test_no_warning(cc: str, level: str, tmp_path: Path) -> None:
    for fmi in VERSIONS:
        write_sources(tmp_path / str(fmi), fmi)
        compile_in(tmp_path / str(fmi), fmi, [level], compiler(cc))


def exported(library: Path) -> set[str]:
    done = subprocess.run(["nm", "-D", library], capture_output=True, text=True, check=True)
    return set(re.findall(r" T (\w+)", done.stdout))


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
def test_names_of_functions(
    define: Sequence[str], prefix: str, fmi: Literal[2, 3], tmp_path: Path
) -> None:
    write_sources(tmp_path / "c", fmi)
    defined = [text.format(fmi) for text in define]
    source = tmp_path / "c" / f"{NAME}.c"
    command = ["gcc", "-std=c99", "-O0", "-fPIC", "-shared", *defined]
    names = exported(compile_c([*command, source, "-lm"], tmp_path / "found.so"))
    assert len(names) == {2: 44, 3: 75}[fmi]
    assert all(name.startswith(f"{prefix}fmi{fmi}") for name in names)


def test_two_fmus_in_one_program(tmp_path: Path) -> None:
    """All but the functions is static: there is no clash, and each has its own."""
    objects: list[str | Path] = []
    for prefix in (f"{NAME}_", "Other_"):
        write_sources(tmp_path / prefix)
        source = tmp_path / prefix / f"{NAME}.c"
        alone = ["gcc", "-std=c99", "-O0", f"-DFMI2_FUNCTION_PREFIX={prefix}", "-c"]
        objects.append(compile_c([*alone, source], source.with_suffix(".o")))
    include = f"-I{tmp_path}/{NAME}_"
    linked = ["gcc", "-std=c99", *STRICT, f'-DGUID="{GUID}"', include, str(LINK)]
    subprocess.run([*linked, *objects, "-lm", "-o", "both"], cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "both"], capture_output=True, text=True, check=True)
    assert done.stdout == "0.5 1\n"


def instantiated(library: Path) -> tuple[bool, list[str]]:
    """Whether there is an instance, and what it says, in a process that may end."""
    script = (
        "import sys\nfrom test_compiled_slave import tried\nlives, said = tried(sys.argv[1])\n"
        "print(lives, *said, sep='\\n')\n"
    )
    paths = ":".join(str(Path(__file__).parents[k]) for k in (0, 2))
    command = [sys.executable, "-c", script, str(library)]
    done = subprocess.run(
        command, capture_output=True, text=True, env={"PYTHONPATH": paths}, check=True
    )
    lives, *said = done.stdout.splitlines()
    return lives == "True", said


def tried(library: str) -> tuple[bool, list[str]]:
    """Whether a library makes an instance, and what it says."""
    said: list[str] = []
    kind = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
    log = kind(lambda *message: said.append(message[-1].decode()))
    callbacks = (c_void_p * 5)(ctypes.cast(log, c_void_p))
    loaded = ctypes.CDLL(library)
    loaded.fmi2Instantiate.restype = c_void_p
    found = loaded.fmi2Instantiate(b"one", 1, GUID.encode(), None, callbacks, 0, 0)
    return bool(found), said


FAST = "infinity, NaN, -0.0 and sums are not those of IEEE 754: must be compiled without"
FUSED = "a * b + c is not rounded twice: must be compiled with -ffp-contract=off"
SMALL = "numbers below 2.3e-308 become 0: must be compiled and linked without -ffast-math"


def has_fma() -> bool:
    cpu = Path("/proc/cpuinfo")
    return cpu.is_file() and " fma " in cpu.read_text()


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() != "x86_64", reason="NO x86-64")
@pytest.mark.parametrize("cc", ["gcc", platforms("clang")])
@pytest.mark.parametrize(
    ("options", "reason"),
    [
        slow(["-ffp-contract=off", "-march=native"], None),
        slow(["-ffp-contract=off", "-march=native", "-O3"], None),
        (["-ffp-contract=fast", "-march=native"], FUSED),
        slow(["-ffp-contract=off", "-ffinite-math-only"], FAST),
        slow(["-ffp-contract=off", "-fno-signed-zeros"], FAST),
        slow(
            ["-ffp-contract=off", "-fassociative-math", "-fno-signed-zeros", "-fno-trapping-math"],
            FAST,
        ),
        slow(["-Ofast"], FAST),
    ],
)
def test_a_compiler_that_calculates_otherwise_makes_no_instance(
    cc: str, options: list[str], reason: str | None, tmp_path: Path
) -> None:
    if "-march=native" in options and not has_fma():
        pytest.skip("NO fused multiply-add in this processor")
    write_sources(tmp_path / "c")
    plain = ["-std=c99", "-O2", "-fPIC", "-shared", "-DFMI2_OVERRIDE_FUNCTION_PREFIX"]
    command = [compiler(cc), *plain, *options, f"{NAME}.c", "-o", "fast.so", "-lm"]
    subprocess.run(command, cwd=tmp_path / "c", check=True)
    lives, said = instantiated(tmp_path / "c" / "fast.so")
    assert lives == (reason is None)
    assert len(said) == (not lives)
    assert lives or said[0].startswith(f"one, t = 0 s: {reason}")


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() != "x86_64", reason="NO x86-64")
def test_a_processor_that_drops_small_numbers_makes_no_instance(tmp_path: Path) -> None:
    """As a library that is linked with -ffast-math leaves it in the thread that loads it."""
    write_sources(tmp_path / "c")
    library = compile_in(tmp_path / "c")
    (tmp_path / "c" / "empty.c").write_text("int nothing;\n", "utf-8")
    plain = ["-fPIC", "-shared", "empty.c", "-L.", f"-l:{library.name}", "-Wl,-rpath,$ORIGIN"]
    done = subprocess.run(
        ["gcc", "-Ofast", "-Wl,--no-as-needed", *plain, "-o", "over.so"],
        cwd=tmp_path / "c", check=False, capture_output=True,
    )  # fmt: skip
    assert done.returncode == 0
    lives, said = instantiated(tmp_path / "c" / "over.so")
    assert not lives
    assert SMALL in said[0]


def drive(fmu: Fmu) -> None:
    """Calls that write texts and states, that are refused and discarded."""
    with Instance(fmu, "é" * 300, logging=True) as instance:
        instance.initialise(force=1e300, mass=1e-3)
        for fault in range(7):
            instance.call(
                "SetInteger", (ctypes.c_uint * 1)(9), ctypes.c_size_t(1), (c_int * 1)(fault)
            )
            instance.step(0.0, 1e-3)
            instance.get_real([2, 3])
            instance.step(0.0, 1e300)
        data = instance.state().to_bytes()
        for bad in (data[:-1], data[:10], b"graspFMU" + b"\xff" * 200, b"\0" + data[1:], b""):
            assert instance.from_bytes(bad)[0] == ERROR
        status, state = instance.from_bytes(data)
        assert (status, instance.restore(state)) == (OK, OK)
        state.free()
        assert instance.call("Reset") == OK


@pytest.mark.slow
def test_the_undefined_behaviour_sanitizer_finds_nothing(tmp_path: Path) -> None:
    path = native_fmu(tmp_path / "fmu")
    write_sources(tmp_path / "c")
    checks = ["-fsanitize=undefined,float-cast-overflow", "-fno-sanitize-recover=all", "-O1", "-g"]
    fmu = Fmu(path, tmp_path / "unpacked")
    fmu.library = ctypes.CDLL(str(compile_in(tmp_path / "c", 2, checks)))
    fmu.library.fmi2Instantiate.restype = c_void_p
    drive(fmu)


CHECKED = Path(__file__).with_name("checked_host.c")
CHECKERS = {
    "valgrind": (["-O1"], ["valgrind", "-q", "--error-exitcode=9", "--leak-check=full"]),
    "address": (["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"], []),
}


@pytest.mark.slow
@pytest.mark.parametrize("checker", CHECKERS)
@pytest.mark.parametrize("cc", COMPILERS)
def test_checkers_of_memory_find_nothing(cc: str, checker: str, tmp_path: Path) -> None:
    """In a host in C, which is linked with the FMU and calls most of what there is."""
    options, prefix = CHECKERS[checker]
    for program in prefix[:1]:
        compiler(program)
    write_sources(tmp_path / "c")
    names = [f'-DGUID="{GUID}"', "-DFMI2_OVERRIDE_FUNCTION_PREFIX", f"-I{tmp_path}/c"]
    command = [compiler(cc), "-std=c99", "-ffp-contract=off", *options, *names, str(CHECKED)]
    subprocess.run([*command, f"{NAME}.c", "-o", "host", "-lm"], cwd=tmp_path / "c", check=True)
    done = subprocess.run([*prefix, tmp_path / "c" / "host"], capture_output=True)
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.splitlines()[-1] == b"done"
