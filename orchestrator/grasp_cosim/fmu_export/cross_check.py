"""Makes the files of the FMI cross-check next to an FMU: inputs, reference results, options.

Format: FMI cross-check rules 4.1, sections 9.1.4 and 10. Why they are as they are: fmus/README.md.
"""

import math
from collections.abc import Iterator
from typing import Any

from .contract import Block, Field, Variable, declared, packer, unpacker, variables

STEP_SIZE = 1.0 / 256.0
STEPS = 768
"""FMPy's cross-check warns of more than 1,000 rows, the rules refuse more than a megabyte."""


def cross_check_files(name: str, block: Block) -> dict[str, bytes]:
    """Return NAME_in.csv, NAME_ref.csv and NAME_ref.opt of the FMU `name`, by file name.

    ValueError if an output of the block is not finite.
    """
    fields = declared(block)
    inputs = [v for v in variables(fields) if v.causality == "input"]
    outputs = [v for v in variables(fields) if v.causality == "output"]
    times = [k * STEP_SIZE for k in range(STEPS + 1)]
    samples = [[_signal(v, i, t) for i, v in enumerate(inputs)] for t in times]
    results = list(_run(block, fields, samples))
    for t, row in zip(times, results, strict=True):
        for v, value in zip(outputs, row, strict=True):
            if not math.isfinite(value):
                raise ValueError(f"{name}: {v.name} = {value!r} at {t} s: must be finite")
    return {
        f"{name}_in.csv": _csv(inputs, times, samples),
        f"{name}_ref.csv": _csv(outputs, times, results),
        f"{name}_ref.opt": _options(times[0], times[-1]),
    }


def _run(block: Block, fields: list[Field], samples: list[list[Any]]) -> Iterator[list[Any]]:
    """Yield the outputs after initialisation and after every step."""
    p, pack, unpack = block.Params(), packer(block.Inputs, fields), unpacker(fields)
    inputs = [pack(sample) for sample in samples]
    x = block.initial_state(p, inputs[0])
    yield unpack(block.outputs(p, x, inputs[0]))
    for u in inputs[:-1]:
        x = block.step(p, x, u, STEP_SIZE)
        yield unpack(block.outputs(p, x, u))


def _csv(columns: list[Variable], times: list[float], rows: list[list[Any]]) -> bytes:
    lines = [",".join(['"time"', *(f'"{v.name}"' for v in columns)])]
    lines += [",".join([repr(t), *map(_literal, row)]) for t, row in zip(times, rows, strict=True)]
    return ("\n".join(lines) + "\n").encode()


def _literal(value: float | bool) -> str:
    return str(int(value)) if isinstance(value, bool) else repr(float(value))


def _options(start: float, stop: float) -> bytes:
    """Return the options without the rules' SolverType: FMPy reads numbers only."""
    options = {"StartTime": start, "StopTime": stop, "StepSize": STEP_SIZE}
    options["RelTol"] = 1e-6  # for the comparison: mathematical libraries differ in the last digit
    options["OutputIntervalLength"] = STEP_SIZE
    return "".join(f"{name}, {value!r}\n" for name, value in options.items()).encode()


def _signal(v: Variable, number: int, t: float) -> float | bool:
    """Return an input at a time: from its start its own wave frequency, then a jump in it.

    It is never further from the start than the nominal value, and stays on the side of zero on
    which it starts; neighbours begin in opposite directions. A boolean one changes at the jump.
    """
    frequency, jump = 0.25 + 0.125 * number, 1.5 + 0.125 * number
    if v.kind is bool:
        return bool(v.start) != (t >= jump)
    start, nominal = float(v.start or 0.0), v.nominal or 1.0
    size = min(nominal, 0.9 * abs(start)) or nominal
    wave = 0.7 * math.sin(2.0 * math.pi * frequency * t) + (0.3 if t >= jump else 0.0)
    # Rounded, as mathematical libraries differ; interpolation does not keep the sign of -0.0.
    return round(start + size * (wave if number % 2 else -wave), 9) + 0.0
