"""The C of a block alone: compiles, calls nothing but what it lists, gives the block's bits."""

import re
import shutil
import signal
import subprocess
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest
from grasp_cosim.base.c_compilers import BITS
from grasp_cosim.fmu_export.contract import build_params, declared, unpacker
from grasp_cosim.fmu_export.native.c_only import called_of_libm, write_c
from grasp_cosim.fmu_export.own_block import own_model
from grasp_cosim.fmu_export.package import shipped_model
from support.kinds import TRANSLATED
from support.marks import platforms, slow
from support.native_fmus import needs_gcc

ROOT = Path(__file__).parents[3]
SPRING = ROOT / "orchestrator/grasp_cosim/inspection/templates/spring_plant.py"
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
    compiled(folder, level, *exact, "-c", f"{name}.c", f"{name}_text.c", "main.c",
             compiler=compiler)  # fmt: skip
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
    assert {f"{name}.h", f"{name}.c", f"{name}_text.c", "main.c", "block.h"} <= files.keys()
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


def test_libm_is_what_the_block_calls():
    text = "x = two(floored(x)) + exp(sqrt(x)); /* not log(x) */"
    assert called_of_libm(text) == ["exp", "floor", "sqrt"]


REFUSES = r"""
#include "GraspController.h"
#include <stdio.h>
#include <string.h>

int main(void)
{
    GraspController_Parameters p = GRASPCONTROLLER_PARAMETERS_DEFAULTS;
    GraspController_Inputs u = GRASPCONTROLLER_INPUTS_DEFAULTS, odd;
    GraspController_State x, before, other;
    GraspController_Outputs y, y_before;
    char why[GRASPCONTROLLER_WHY_SIZE];
    double values[] = {1e308, -1e308, 1e300, 0.0 / 0.0, 1.0 / 0.0};
    int k, i, variable, fault;
    GraspController_initial_state(&p, &u, &x, &y, NULL);
    for (k = 0; k < 100; k++)
        GraspController_step(&p, &u, 1e-3, &x, &y, NULL);
    for (k = 0; k < 5; k++) {
        for (i = 0; i < 6; i++) {
            odd = u;
            ((double *)&odd)[i] = values[k];
            before = x, y_before = y, other = x;
            fault = GraspController_step(&p, &odd, 1e-3, &x, &y, &variable);
            if (fault) {
                GraspController_explain(&p, &odd, 1e-3, &before, why);
                printf("%d %d %d %s\n", k, i, variable, why);
                if (memcmp(&x, &before, sizeof x) || memcmp(&y, &y_before, sizeof y))
                    return 2;
            } else if (GraspController_step(&p, &u, 1e-3, &x, &y, NULL)) {
                return 3; /* it took what it cannot go on with */
            }
            x = other;
        }
    }
    p.contact_force_stiffness = -1.0;
    printf("%d ", GraspController_check(&p, &variable));
    GraspController_explain(&p, &u, 0.0, &x, why);
    printf("%d %s\n", variable, why);
    return 0;
}
"""


def test_what_is_refused_changes_nothing_and_is_told_by_a_code(written, tmp_path):
    """Values that are none, and those that it could not go on with."""
    folder = written("GraspController")
    (tmp_path / "refuses.c").write_text(REFUSES)
    files = [tmp_path / "refuses.c", *(folder / f"GraspController{e}.c" for e in ("", "_text"))]
    command = ["gcc", "-std=c99", "-I", folder, *files, "-o", tmp_path / "refuses", "-lm"]
    subprocess.run(command, check=True)
    done = subprocess.run([tmp_path / "refuses"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    *steps, parameter = done.stdout.splitlines()
    assert parameter == "1 28 contact_force.stiffness = -1.0 N/m: must be from 0 to 1e+06 N/m"
    none = [line.split(" ", 3) for line in steps if line[0] in "34"]
    assert [(int(i), int(variable)) for _, i, variable, _ in none] == [(i, i) for i in range(6)] * 2
    assert none[0][3] == "position[1] = nan m: must be a finite number"
    large = [line for line in steps if line.startswith("0 ")]
    assert large
    assert all(line.endswith("must be a finite number") or "too large" in line for line in large)


HOSTILE = r"""
#include "$name.h"
#include <stdio.h>

int main(void)
{
    $name_Parameters p = $UPPER_PARAMETERS_DEFAULTS;
    $name_Inputs u = $UPPER_INPUTS_DEFAULTS, odd;
    $name_State x, begun;
    $name_Outputs y;
    double values[] = {1e308, -1e308, 1e300, 1e200, 1e155};
    unsigned k, i, n;
    if ($name_check(&p, NULL) || $name_initial_state(&p, &u, &begun, &y, NULL))
        return 1;
    for (k = 0; k < 5; k++) {
        for (i = 0; i < $reals; i++) {
            odd = u;
            x = begun;
            ((double *)&odd)[i] = values[k];
            (void)$name_step(&p, &odd, 1e-3, &x, &y, NULL);
            for (n = 0; n < 20; n++)
                if ($name_step(&p, &u, 1e-3, &x, &y, NULL)) {
                    printf("input %u = %g\n", i, values[k]);
                    break;
                }
        }
    }
    return 0;
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", TRANSLATED)
def test_no_single_input_leaves_a_state_that_cannot_go_on(name, written, tmp_path):
    folder = written(name)
    with model_of(name) as model:
        fields = [f for f in declared(model.block) if f.causality == "input"]
    if any(f.kind is not float for f in fields):
        pytest.skip("not all inputs are Reals")
    text = HOSTILE.replace("$name", name).replace("$UPPER", name.upper())
    text = text.replace("$reals", str(sum(len(f.names) for f in fields)))
    (tmp_path / "hostile.c").write_text(text)
    command = ["gcc", "-std=c99", "-I", folder, tmp_path / "hostile.c", folder / f"{name}.c"]
    subprocess.run([*command, "-o", tmp_path / "hostile", "-lm"], check=True)
    done = subprocess.run([tmp_path / "hostile"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "")


@pytest.mark.slow
def test_the_example_writes_the_safe_state_whatever_ends_it(written):
    """First, and last: at its end, on a signal, where a step is refused; after it nothing else."""
    folder = written("GraspController")
    source = (folder / "main.c").read_text()
    waits = source.replace("/* Here: wait until the step is due */", "fflush(stdout);")
    command = re.search(r"^ \* {5}(cc .*)$", source, re.MULTILINE)[1]
    (folder / "slow.c").write_text(
        waits.replace("fprintf(stderr", "fflush(stdout); fprintf(stdout")
    )
    subprocess.run(command.replace("main.c", "slow.c"), cwd=folder, shell=True, check=True)
    program = folder / "GraspController"
    whole = subprocess.run([program, "3", "1e-3"], capture_output=True, text=True)
    lines = whole.stdout.splitlines()
    assert (whole.returncode, lines[0], lines[-1], len(lines)) == (0, "safe", "safe", 6)
    refused = subprocess.run([program, "3", "-1"], capture_output=True, text=True)
    assert refused.returncode == 1
    assert refused.stdout.splitlines()[0] == refused.stdout.splitlines()[-1] == "safe"
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        with subprocess.Popen(
            [program, "2000000000"], stdout=subprocess.PIPE, text=True
        ) as running:
            assert running.stdout.readline() == "safe\n"
            running.stdout.readline()
            running.send_signal(number)
            assert running.stdout.read().splitlines()[-1] == "safe"
        assert running.returncode == 0
