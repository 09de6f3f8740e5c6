"""The sources of native FMUs in the hands of those who compile them: real-time targets, old tools.

Each file to compile is compiled alone, with nothing but its own folder, and linked with others.
"""

import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from fmus.native.mass import GUID, NAME, compile_in, write_sources
from grasp_cosim.base.c_compilers import LIBM
from support.compiled import compile_c
from support.direct import COMPONENTS
from support.kinds import TRANSLATED
from support.marks import slow
from support.platforms import MINGW, needs_programs

PLAIN = ["gcc", "-std=c99", "-O1", "-ffp-contract=off"]

pytestmark = pytest.mark.skipif(not shutil.which("gcc"), reason="NO gcc")


def sources(fmu):
    return fmu.folder / "sources"


def words(path):
    """C without its comments and texts."""
    text = re.sub(r"/\*.*?\*/", " ", path.read_text("ascii"), flags=re.DOTALL)
    return re.sub(r'"(?:\\.|[^"\\])*"', '""', text)


@pytest.fixture
def fmu(parts, name):
    return parts[name].fmu


every = pytest.mark.parametrize("name", TRANSLATED)


@pytest.mark.slow
def test_three_fmus_link_into_one_program(parts_of, tmp_path):
    """Each is compiled alone, also in folders of the others, and leaves no name open."""
    fmus = [parts_of(2)[name].fmu for name in dict.fromkeys(COMPONENTS.values())]
    objects = []
    for fmu in fmus:
        others = [f"-I{sources(other)}" for other in fmus if other is not fmu]
        made = []
        for i, options in enumerate((others, [])):
            made.append(tmp_path / f"{fmu.name}_{i}.o")
            command = [*PLAIN, "-fPIC", *options, "-c", sources(fmu) / f"{fmu.name}.c"]
            subprocess.run([*command, "-o", made[-1]], check=True)
        assert made[0].read_bytes() == made[1].read_bytes()
        objects.append(made[0])
    command = ["gcc", "-shared", "-Wl,--no-undefined", *objects, "-lm", "-o", tmp_path / "it.so"]
    subprocess.run(command, check=True)


@pytest.mark.slow
@every
def test_all_but_the_functions_of_fmi_is_static(fmu, tmp_path):
    """Nothing to clash, and nothing that can be written: no state of the process.

    One function is not of FMI: where the values are.
    """
    done = tmp_path / "it.o"
    subprocess.run([*PLAIN, "-c", sources(fmu) / f"{fmu.name}.c", "-o", done], check=True)
    listed = subprocess.run(
        ["nm", "--format=posix", done], capture_output=True, text=True, check=True
    ).stdout
    kinds = {}
    for line in listed.splitlines():
        symbol, kind, *_ = line.split()
        kinds.setdefault(kind, set()).add(symbol)
    more = {f"{fmu.name}_graspValues"} if fmu.fmi == 2 else set()
    others = {s for s in kinds["T"] if not s.startswith(f"{fmu.name}_fmi{fmu.fmi}")}
    assert others == more
    assert len(kinds["T"] - more) == {2: 44, 3: 75}[fmu.fmi]
    assert not kinds.keys() & set("BbCGgSsVvWw")
    # what is in the section for data holds addresses, and is constant but for the linker's work
    assert kinds.get("D", set()) == set()
    writable = subprocess.run(["objdump", "-h", done], capture_output=True, text=True, check=True)
    sizes = re.findall(r"^ *\d+ (\.data|\.bss) +([0-9a-f]+)", writable.stdout, re.MULTILINE)
    assert sizes
    assert all(int(size, 16) == 0 for _, size in sizes)
    memory = {"malloc", "free", "memcpy", "memset", "memcmp", "memmove"}
    texts = {"strlen", "strcmp", "strcpy", "strcat", "strcspn", "strncmp", "strchr"}
    linker = {"_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}
    plain = {"floor", "ceil", "fabs", "sqrt", "copysign", "sincos"}  # gcc makes one of two
    assert kinds["U"] <= {*LIBM, *memory, *texts, *linker, *plain}


@every
def test_one_file_to_compile_and_no_file_too_many(fmu):
    """All others are included by it, and none from elsewhere, but of C itself."""
    files = {path.name for path in sources(fmu).iterdir()} - {"buildDescription.xml"}
    assert {name for name in files if not name.endswith(".h")} == {f"{fmu.name}.c"}
    reached, left, of_c = set[str](), [f"{fmu.name}.c"], set[str]()
    while left:
        name = left.pop()
        if name not in reached:
            reached.add(name)
            text = (sources(fmu) / name).read_text("ascii")
            left += re.findall(r'^\s*#\s*(?:include|define SLAVE)\s+"([^"]+)"', text, re.MULTILINE)
            of_c |= {*re.findall(r"^\s*#\s*include\s+<([^>]+)>", text, re.MULTILINE)}
    assert reached == files
    assert of_c <= {
        "float.h", "math.h", "stdarg.h", "stdbool.h", "stddef.h", "stdint.h", "stdlib.h",
        "string.h",
    }  # fmt: skip


@every
def test_c_that_old_and_strict_compilers_take(fmu):
    """No `for (int`, no //, no complex, no array of variable length; GNU's for GNU alone."""
    for path in sources(fmu).glob("*.[ch]"):
        if path.name.startswith(("fmi2Func", "fmi2Types", "fmi3Func", "fmi3Platf")):
            continue  # the standard's own
        text = re.sub(r"#ifdef __GNUC__.*?#endif", "", words(path), flags=re.DOTALL)
        found = re.findall(
            r"for\s*\(\s*(?:int|size_t|double)\b|//|__typeof__|__attribute__|__builtin|"
            r"\(\s*\{|\basm\b|\b_Complex\b|\balloca\b|\brestrict\b|\b__int128\b|0[bB][01]+\b",
            text,
        )
        assert found == [], path.name
        assert "\t" not in text
        assert max(len(line) for line in path.read_text("ascii").splitlines()) <= 120, path.name


STRICT = {
    "gcc, as old ones": [
        "gcc", "-std=c99", "-pedantic-errors", "-Wall", "-Wextra", "-Werror", "-Wvla",
        "-Wshadow", "-Wundef",
    ],
    "gcc, newer C": ["gcc", "-std=c17", "-pedantic-errors", "-Wall", "-Wextra", "-Werror"],
    "gcc, GNU's C": ["gcc", "-std=gnu99", "-Wall", "-Wextra", "-Werror"],
    "clang, everything but style": [
        "clang", "-std=c99", "-Weverything", "-Werror", "-Wno-unknown-warning-option",
        "-Wno-padded", "-Wno-float-equal", "-Wno-declaration-after-statement",
        "-Wno-disabled-macro-expansion", "-Wno-strict-prototypes", "-Wno-unsafe-buffer-usage",
        "-Wno-double-promotion",
    ],
    "mingw": [MINGW, "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"],
    "aarch64": ["aarch64-linux-gnu-gcc", "-std=c99", "-Wall", "-Wextra", "-Werror"],
    "gcc, 32 bit": ["gcc", "-m32", "-msse2", "-mfpmath=sse", "-std=c99", "-Wall", "-Werror"],
}  # fmt: skip
ELSEWHERE = ("mingw", "aarch64", "gcc, 32 bit")


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        pytest.param(words, id=name, marks=[pytest.mark.platforms] * (name in ELSEWHERE))
        for name, words in STRICT.items()
    ],
)
@every
def test_strict_compilers_say_nothing(fmu, options, tmp_path):
    if not shutil.which(options[0]):
        pytest.skip(f"NO {options[0]}")
    if "-m32" in options and not Path("/usr/include/gnu/stubs-32.h").exists():
        pytest.skip("NO headers for 32 bit")
    command = [*options, "-fsyntax-only", f"{fmu.name}.c"]
    done = subprocess.run(command, cwd=sources(fmu), capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


# Of the mass


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
    assert len(names) == {2: 45, 3: 75}[fmi]
    others = {name for name in names if not name.startswith(f"{prefix}fmi{fmi}")}
    assert others == ({f"{prefix}graspValues"} if fmi == 2 else set())


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
@pytest.mark.parametrize(
    "cc", ["gcc", pytest.param("clang", marks=[pytest.mark.platforms, needs_programs("clang")])]
)
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
    command = [cc, *plain, *options, f"{NAME}.c", "-o", "fast.so", "-lm"]
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
