"""What a step of each block costs in C, as shipped and with all that it has switched on.

    python -m benchmarks.blocks

Each block runs through the inputs of its cross-check, 3 s, at 8192 Hz: the sub-steps
asked for, the step and the outputs, without the FMU around them. ns of CPU time, means over a run.
"""

import csv
import io
import statistics
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from c_compilers import BITS, LIBM
from grasp_fmus.contract import declared, variables
from grasp_fmus.cross_check import STEP_SIZE, cross_check_files
from grasp_fmus.native.blocks import translated
from grasp_fmus.native.c_only import FOLDER, HELPERS
from grasp_fmus.shipped import blocks

from benchmarks.harness import head, row

PROGRAM = Path(__file__).parent / "native" / "block.c"
HELD = 32
ROUNDS = 30

RUBBING = {"friction.coulomb": 0.1, "friction.static": 0.3, "friction.viscous": 0.1}


def everything(found: list[Any]) -> dict[int, float]:
    """Values by reference: all switches on, and friction with a breakaway force."""
    values = {i: 1.0 for i, v in enumerate(found) if v.name.endswith("enabled")}
    rubbing = ((i, RUBBING.get(v.name.partition("[")[0])) for i, v in enumerate(found))
    return values | {i: value for i, value in rubbing if value is not None}


def rows(name: str, block: Any) -> str:
    """rows.h: the inputs of the cross-check."""
    text = cross_check_files(name, block)[f"{name}_in.csv"].decode()
    samples = [line[1:] for line in csv.reader(io.StringIO(text))][1:]
    lines = "".join(f"    {{{', '.join(sample)}}},\n" for sample in samples)
    return (
        f"#define ROWS {len(samples)}\n#define HELD {HELD}\n#define H {STEP_SIZE / HELD!r}\n"
        f"static const double rows[ROWS][{len(samples[0])}] = {{\n{lines}}};\n"
    )


def built(name: str, block: Any, folder: Path) -> Path:
    """The program that runs a block. FileNotFoundError without gcc."""
    sources = {"block.h": translated(name, block), "rows.h": rows(name, block)}
    sources |= {helper: (FOLDER / "c" / helper).read_text("utf-8") for helper in HELPERS}
    for file, text in sources.items():
        (folder / file).write_text(text)
    flags = [*BITS, *(f"-fno-builtin-{function}" for function in LIBM), "-w", "-I", str(folder)]
    program = folder / "block"
    compiler = ["gcc", *flags]
    subprocess.run([*compiler, str(PROGRAM), "-o", str(program), "-lm"], check=True)
    return program


def measured(program: Path, values: Mapping[int, float]) -> list[float]:
    """ns per step, for each round."""
    given = [f"{i}={value!r}" for i, value in values.items()]
    command = [str(program), str(ROUNDS), *given]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return [float(line) for line in done.stdout.split()[:ROUNDS]]


def main() -> None:
    """Print the table."""
    head("block", "as shipped, best", "median", "all on, best", "median")
    for name, block in blocks().items():
        found = variables(declared(block))
        with tempfile.TemporaryDirectory(prefix="grasp_bench_") as folder:
            program = built(name, block, Path(folder))
            plain, full = measured(program, {}), measured(program, everything(found))
        figures = (min(plain), statistics.median(plain), min(full), statistics.median(full))
        row(name, *(f"{figure:.0f} ns" for figure in figures))


if __name__ == "__main__":
    main()
