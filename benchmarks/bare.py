"""The limit of a master: the blocks of the grasp as one C program, without FMI and without checks.

A block of a native FMU is a header, block.h. Each block is compiled as it is. A loop of plain C
calls the blocks, copies values from one to the next, and writes a row of all outputs. The compiler
sees all of it at once. The signals have the bits of a run with the Jacobi scheme.
"""

import ctypes
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from zipfile import ZipFile

import numpy as np
import numpy.typing as npt
from grasp_cosim import System
from grasp_cosim.base.c_compilers import BITS, LIBM, find_compiler
from grasp_cosim.interface.variables import Variable
from grasp_cosim.system.parts import Component

BLOCK = """\
#include "block.h"
#include <stdlib.h>

typedef struct {{
    BlockParams params;
    BlockState states[2];
    int at;
}} Model;

static void put_outputs(const Model *m, const BlockInputs *u, double *outputs) {{
    BlockOutputs y;
    block_outputs(&m->params, &m->states[m->at], u, &y);
    block_outputs_to(&y, outputs);
}}

void *{model}_new(const double *values) {{
    Model *m = calloc(1, sizeof *m);
    block_params(values, &m->params);
    return m;
}}

void {model}_start(void *model, const double *inputs, double *outputs) {{
    Model *m = model;
    BlockInputs u;
    block_inputs(inputs, &u);
    block_initial_state(&m->params, &u, &m->states[m->at]);
    put_outputs(m, &u, outputs);
}}

void {model}_step(void *model, const double *inputs, double h, double *outputs) {{
    Model *m = model;
    BlockInputs u;
    block_inputs(inputs, &u);
    block_step(&m->params, &m->states[m->at], &u, h, &m->states[!m->at]);
    m->at = !m->at;
    put_outputs(m, &u, outputs);
}}
"""

LOOP = """\
#include <stdlib.h>
#include <string.h>

{declared}
static double inputs[{n_inputs}], outputs[{n_outputs}];
static void *models[{n_models}];

static void pass(void) {{
{passed}
}}

void start(void) {{
    int i;
{made}
    for (i = 0; i < {n_models}; i++) {{ /* until each has the outputs of the others */
        pass();
{started}
    }}
}}

double *advance(long steps, double *rows) {{
    double *row = rows;
    for (; steps > 0; steps--, row += {n_outputs}) {{
        pass();
{stepped}
        memcpy(row, outputs, sizeof outputs);
    }}
    return rows;
}}
"""


class Program(NamedTuple):
    """The compiled program, and the names of its outputs in the order of a row."""

    library: ctypes.CDLL
    outputs: Sequence[str]

    def advance(self, steps: int) -> npt.NDArray[np.float64]:
        """Do so many steps; their rows, in memory that is new to the process if they are many."""
        rows = np.empty((steps, len(self.outputs)))
        self.library.advance(steps, rows.ctypes.data)
        return rows


def bare_program(system: System, step: float, folder: Path) -> Program:
    """Compile a system of native FMUs of our blocks in a folder, for a step in s."""
    inputs, outputs = _places(system, "input"), _places(system, "output")
    for model in {_model(c) for c in system.components}:
        (folder / model).mkdir()
        (folder / f"{model}.c").write_text(BLOCK.format(model=model), "utf-8")
    for component in system.components:
        with ZipFile(component.loaded.path) as archive:
            for name in ("block.h", "arithmetic.h", "variable.h"):
                to = folder / _model(component) / name
                to.write_bytes(archive.read(f"sources/{name}"))
    (folder / "loop.c").write_text(_loop(system, step, inputs, outputs), "utf-8")
    return Program(_compiled(folder), [*outputs])


def _compiled(folder: Path) -> ctypes.CDLL:
    """The library of all sources: each block on its own, as their names are the same, then linked
    in one piece."""
    flags = (*BITS, *(f"-fno-builtin-{name}" for name in LIBM), "-fPIC", "-flto")
    objects = []
    for source in sorted(folder.glob("*.c")):
        objects.append(str(source.with_suffix(".o")))
        headers = f"-I{source.with_suffix('')}"
        command = (*find_compiler().command, *flags, headers, "-c", str(source), "-o", objects[-1])
        subprocess.run(command, check=True)
    library = folder / "bare.so"
    linked = (*find_compiler().command, *flags, "-shared", *objects, "-lm", "-o", str(library))
    subprocess.run(linked, check=True)
    loaded = ctypes.CDLL(str(library))
    loaded.advance.argtypes = [ctypes.c_long, ctypes.c_void_p]
    loaded.start()
    return loaded


def _loop(system: System, step: float, inputs: dict[str, int], outputs: dict[str, int]) -> str:
    """The C of the loop over the components of a system."""
    declared, made, started, stepped = [], [], [], []
    for model in sorted({_model(c) for c in system.components}):
        declared += [
            f"void *{model}_new(const double *);",
            f"void {model}_start(void *, const double *, double *);",
            f"void {model}_step(void *, const double *, double, double *);",
        ]
    for i, c in enumerate(system.components):
        first_input = min((at for name, at in inputs.items() if _is_of(name, c)), default=0)
        first_output = min(at for name, at in outputs.items() if _is_of(name, c))
        values = ", ".join(repr(_start(c, v)) for v in _variables(c))
        made.append(
            f"    {{ static const double values[] = {{{values}}};\n"
            f"      models[{i}] = {_model(c)}_new(values); }}"
        )
        ends = f"models[{i}], inputs + {first_input}", f"outputs + {first_output}"
        started.append(f"        {_model(c)}_start({', '.join(ends)});")
        stepped.append(f"        {_model(c)}_step({ends[0]}, {step!r}, {ends[1]});")
    passed = [
        f"    inputs[{inputs[str(c.target)]}] = outputs[{outputs[str(c.source)]}];"
        for c in system.connections
    ]
    return LOOP.format(
        n_inputs=len(inputs),
        n_outputs=len(outputs),
        n_models=len(system.components),
        declared="\n".join(declared),
        passed="\n".join(passed),
        made="\n".join(made),
        started="\n".join(started),
        stepped="\n".join(stepped),
    )


def _places(system: System, causality: str) -> dict[str, int]:
    """The inputs or outputs of all components by their full names, and their places."""
    names = [
        f"{c.name}.{v.name}"
        for c in system.components
        for v in _variables(c)
        if v.causality == causality
    ]
    return {name: place for place, name in enumerate(names)}


def _variables(component: Component) -> list[Variable]:
    """The variables of a block in the order of its values: inputs, outputs, parameters."""
    interface = component.loaded
    return [v for kind in ("input", "output", "parameter") for v in interface.of(kind)]


def _start(component: Component, variable: Variable) -> float:
    """The start value of a variable as the system has it."""
    return float(component.values.get(variable.name, variable.start_value or 0.0))  # type: ignore[arg-type]


def _is_of(name: str, component: Component) -> bool:
    return name.startswith(f"{component.name}.")


def _model(component: Component) -> str:
    return component.loaded.identifier
