"""The sources of native FMUs in the hands of those who compile them: real-time targets, old tools.

Each file to compile is compiled alone, with nothing but its own folder, and linked with others.
"""

import ctypes
import re
import shutil
import subprocess
from collections.abc import Callable
from copy import copy
from pathlib import Path

import numpy as np
import pytest
from c_compilers import LIBM
from support.c_host import COMPONENTS, CONNECTIONS, rows_in_python
from support.fmi2 import OK, Instance
from support.kinds import TRANSLATED
from support.platforms import MINGW, Parts

PLAIN = ["gcc", "-std=c99", "-O1", "-ffp-contract=off"]

PartsOf = Callable[[int], Parts]

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


every = pytest.mark.parametrize(
    "name",
    TRANSLATED,
)


# Linked into one program


class Prefixed:
    """Those functions of a library whose names begin with a prefix, without it."""

    def __init__(self, library, prefix):
        self._library, self._prefix = library, prefix
        self.fmi2Instantiate.restype = ctypes.c_void_p

    def __getattr__(self, name):
        return getattr(self._library, self._prefix + name)


@pytest.mark.slow
@pytest.mark.parametrize("given", [False, True])
def test_three_fmus_in_one_program_are_the_grasp(given, parts_of, tmp_path):
    """Each compiled alone, first in folders of the others, and linked with no name left open."""
    fmus = {name: part.fmu for name, part in parts_of(2).items() if name in COMPONENTS.values()}
    objects, grasp = [], {}
    for name, fmu in fmus.items():
        others = [f"-I{sources(fmus[other])}" for other in fmus if other != name]
        own = [f"-DFMI2_FUNCTION_PREFIX=rt_{name}_"] if given else []
        objects.append(tmp_path / f"{name}.o")
        command = [*PLAIN, "-fPIC", *others, *own, "-c", sources(fmu) / f"{name}.c"]
        subprocess.run([*command, "-o", objects[-1]], check=True)
    whole = tmp_path / "whole.so"
    command = ["gcc", "-shared", "-Wl,--no-undefined", *objects, "-lm", "-o", whole]
    subprocess.run(command, check=True)
    for component, name in COMPONENTS.items():
        fmu = copy(fmus[name])
        fmu.library = Prefixed(ctypes.CDLL(str(whole)), f"rt_{name}_" if given else f"{name}_")
        grasp[component] = Instance(fmu)
        assert (grasp[component].setup(), grasp[component].enter()) == (OK, OK)

    def feed(component):
        for source, output, target, name in CONNECTIONS:
            if target == component:
                assert grasp[component].set({name: grasp[source].get(output)[0]}) == OK

    for component in ("sensor_1", "sensor_2", "controller"):
        feed(component)
    assert [part.exit() for part in grasp.values()] == [OK] * 4
    rows = [grasp["plant"].get("position[1]", "position[2]")]
    for k in range(200):
        for component, part in grasp.items():
            feed(component)
            assert part.step(k * 1e-3, 1e-3) == OK
        rows.append(grasp["plant"].get("position[1]", "position[2]"))
    assert np.array_equal(rows, rows_in_python({}, 200, 1e-3)[:, :2])


@pytest.mark.slow
@every
def test_all_but_the_functions_of_fmi_is_static(fmu, tmp_path):
    """Nothing to clash, and nothing that can be written: no state of the process."""
    done = tmp_path / "it.o"
    subprocess.run([*PLAIN, "-c", sources(fmu) / f"{fmu.name}.c", "-o", done], check=True)
    listed = subprocess.run(
        ["nm", "--format=posix", done], capture_output=True, text=True, check=True
    ).stdout
    kinds = {}
    for line in listed.splitlines():
        symbol, kind, *_ = line.split()
        kinds.setdefault(kind, set()).add(symbol)
    assert all(symbol.startswith(f"{fmu.name}_fmi{fmu.fmi}") for symbol in kinds["T"])
    assert len(kinds["T"]) == {2: 44, 3: 75}[fmu.fmi]
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


# What other tools find in the folder


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
