"""The C of a block alone: compiles, calls nothing but what it lists, gives the block's bits."""

import ctypes
import re
import shutil
import subprocess
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest
from c_compilers import BITS
from grasp_fmus.contract import build_params, declared, packer, unpacker
from grasp_fmus.cross_check import STEP_SIZE, STEPS
from grasp_fmus.native.c_only import called_of_libm, write_c
from grasp_fmus.own_block import own_model
from grasp_fmus.package import shipped_model
from grasp_fmus.shipped import blocks
from support.compiled import compile_c
from support.kinds import TRANSLATED
from support.marks import platforms, slow
from support.native_fmus import needs_gcc

ROOT = Path(__file__).parents[3]
SPRING = ROOT / "docs/spring_plant.py"
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
OF_THE_COMPILER = {"memcpy", "memset", "memmove", "memcmp", "strlen", "strcpy"}
OF_THE_COMPILER |= {"strcmp", "strcspn", "strchr"}
"""Functions of string.h, which a compiler without an operating system has as well."""

pytestmark = needs_gcc


ALLOWED = {"float.h", "math.h", "stdarg.h", "stdbool.h", "stddef.h", "stdint.h", "string.h"}
"""Headers without input and output, memory, or time."""


@contextmanager
def model_of(name):
    """The model of one of ours, or of a user's own block."""
    if name == "SpringPlant":
        with own_model(SPRING) as own:
            yield own
    else:
        yield shipped_model(name)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The folder with the C of a block, written once."""

    @cache
    def folder(name):
        folder = tmp_path_factory.mktemp(name)
        with model_of(name) as model:
            write_c(folder, model)
        return folder

    return folder


def compiled(folder, *options, compiler="gcc"):
    subprocess.run([compiler, *STRICT, *options], cwd=folder, check=True)


@pytest.mark.parametrize("level", ["-O0", slow("-O3")])
@pytest.mark.parametrize("compiler", ["gcc", platforms("clang")])
@pytest.mark.parametrize("name", [*map(slow, TRANSLATED[1:]), TRANSLATED[0], "SpringPlant"])
def test_compiles_without_a_warning_and_calls_what_it_lists(name, compiler, level, written):
    if not shutil.which(compiler):
        pytest.skip(f"NO {compiler}")
    folder = written(name)
    exact = re.findall(r"-fno-builtin-\w+", (folder / "main.c").read_text())
    compiled(folder, level, *exact, "-c", f"{name}.c", "main.c", compiler=compiler)
    said = subprocess.check_output(["nm", "-u", f"{name}.o"], cwd=folder, text=True)
    listed = re.search(r"it calls:\n \*\n \* +(.*)\n", (folder / f"{name}.h").read_text())
    assert listed
    called = {line.split()[-1] for line in said.splitlines()} - OF_THE_COMPILER
    assert called <= {*listed[1].split(", ")}
    symbols = subprocess.check_output(["nm", "-g", f"{name}.o"], cwd=folder, text=True)
    defined = {line.split()[-1] for line in symbols.splitlines() if " U " not in line}
    functions = ("check", "initial_state", "step", "outputs")
    assert defined == {f"{name}_{function}" for function in functions}


@pytest.mark.parametrize("name", [*TRANSLATED, "SpringPlant"])
def test_what_is_written(name, written):
    files = {path.name: path for path in written(name).glob("*.[ch]")}
    assert {f"{name}.h", f"{name}.c", "main.c", "block.h", "arithmetic.h"} <= files.keys()
    texts = [path.read_text("ascii") for file, path in files.items() if file != "main.c"]
    text = "\n".join(texts)
    assert {*re.findall(r"#include <(.*)>", text)} <= ALLOWED
    assert {*re.findall(r'#include "(.*)"', text)} <= files.keys()
    assert not re.search(r"\bfmi[23]", text)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*map(slow, TRANSLATED[1:]), TRANSLATED[0], slow("SpringPlant")])
def test_the_example_runs_by_the_command_at_its_top(name, written):
    """And holds the inputs at their start values, as the block does here."""
    folder = written(name)
    command, run = re.findall(r"^ \* {5}(\S.*)$", (folder / "main.c").read_text(), re.MULTILINE)
    assert all(flag in command for flag in BITS)
    subprocess.run(command, cwd=folder, shell=True, check=True)
    said = subprocess.check_output(run.replace("1000 0.001", "20 0.01"), cwd=folder, shell=True)
    rows = [[float(cell) for cell in line.split()] for line in said.splitlines()]
    with model_of(name) as model:
        block, fields = model.block, declared(model.block)
        p = build_params(block, fields, [start for f in fields for start in f.starts])
        u, listed = block.Inputs(), unpacker(fields)
        x = block.initial_state(p, u)
        for k in range(21):
            expected = [k * 0.01, *map(float, listed(block.outputs(p, x, u)))]
            assert repr(rows[k]) == repr(expected)
            x = block.step(p, x, u, 0.01)


def shared(source, *options):
    command = ["gcc", *STRICT, *options, "-shared", "-fPIC"]
    return ctypes.CDLL(str(compile_c([*command, source, "-lm"], source.with_suffix(".so"))))


class InC:
    """The block in C, called from here; its structs are of doubles but for those of `packing`."""

    def __init__(self, model, folder):
        name = model.description.name
        write_c(folder, model)
        library = shared(folder / f"{name}.c", *BITS)
        self.call = lambda function: getattr(library, f"{name}_{function}")
        self.state = (ctypes.c_double * 64)()
        self.why = ctypes.create_string_buffer(2000)


CONTROLLER_INPUTS = ctypes.c_double * 6


@pytest.fixture(scope="module")
def controller(tmp_path_factory):
    """A controller, and its default parameters as its header has them; made once."""

    @cache
    def made(name):
        folder = tmp_path_factory.mktemp(name)
        c = InC(shipped_model(name), folder)
        (folder / "p.c").write_text(
            f'#include "{name}.h"\n'
            f"const {name}_Parameters defaults = {name.upper()}_PARAMETERS_DEFAULTS;\n"
            "int size = sizeof defaults;\n"
        )
        library = shared(folder / "p.c")
        size = ctypes.c_int.in_dll(library, "size").value
        return c, (ctypes.c_char * size).in_dll(library, "defaults")

    return made


@pytest.mark.parametrize("name", ["GraspController", slow("GraspControllerAdaptive")])
def test_the_same_bits_as_the_block_over_changing_inputs(fmus, controller, name):
    c, p = controller(name)
    block = blocks()[name]
    fields = declared(block)
    pack, listed = packer(block.Inputs, fields), unpacker(fields)
    params = block.Params()
    y = (ctypes.c_double * 16)()
    names = [n for f in fields if f.causality == "input" for n in f.names]
    lines = (fmus / f"{name}_in.csv").read_text().splitlines()
    assert [cell.strip('"') for cell in lines[0].split(",")] == ["time", *names]
    rows = [[float(cell) for cell in line.split(",")[1:]] for line in lines[1:]]
    assert len(rows) == STEPS + 1
    x = block.initial_state(params, pack(rows[0]))
    u = CONTROLLER_INPUTS(*rows[0])
    assert c.call("check")(p, c.why) == 0
    assert c.call("initial_state")(p, u, c.state, c.why) == 0
    for row in rows:
        u = CONTROLLER_INPUTS(*row)
        assert c.call("step")(p, u, ctypes.c_double(STEP_SIZE), c.state, c.why) == 0
        assert c.call("outputs")(p, u, c.state, y, c.why) == 0
        x = block.step(params, x, pack(row), STEP_SIZE)
        expected = listed(block.outputs(params, x, pack(row)))
        assert repr([*y][: len(expected)]) == repr(expected)


def test_libm_is_what_the_block_calls():
    text = "x = two(floored(x)) + exp(sqrt(x)); /* not log(x) */"
    assert called_of_libm(text) == ["exp", "floor", "sqrt"]
