"""Makes the files of the FMI cross-check beside an FMU: inputs, reference results, options.

Format: FMI cross-check rules 4.1, sections 9.1.4 and 10. Why they are as they are: fmus/README.md.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any

from .contract import Block, Field, build_params, declared, packer, unpacker, variables
from .variable import Variable

STEP_SIZE = 1.0 / 256.0
STEPS = 768
"""FMPy's cross-check warns of more than 1,000 rows, the rules refuse more than a megabyte."""

Signal = Callable[[float], float]
"""An input over the time in s."""


def cross_check_files(name: str, block: Block) -> dict[str, bytes]:
    """Return NAME_in.csv, NAME_ref.csv and NAME_ref.opt of the FMU `name`, by file name.

    Without inputs there is no NAME_in.csv. ValueError if an output of the block is not finite.
    """
    fields = declared(block)
    inputs = [v for v in variables(fields) if v.causality == "input"]
    outputs = [v for v in variables(fields) if v.causality == "output"]
    signals = _signals(name, inputs)
    times = [k * STEP_SIZE for k in range(STEPS + 1)]
    samples = [[signal(t) for signal in signals] for t in times]
    results = list(_run(block, fields, samples))
    for t, row in zip(times, results, strict=True):
        for v, value in zip(outputs, row, strict=True):
            if not math.isfinite(value):
                raise ValueError(f"{name}: {v.name} = {value!r} at {t} s: must be finite")
    files = {
        f"{name}_ref.csv": _csv(outputs, times, results),
        f"{name}_ref.opt": _options(times[0], times[-1]),
    }
    return {f"{name}_in.csv": _csv(inputs, times, samples), **files} if inputs else files


def _run(block: Block, fields: list[Field], samples: list[list[Any]]) -> Iterator[list[Any]]:
    """Yield the outputs after initialisation and after every step."""
    start = [value for f in fields for value in f.starts]
    p = build_params(block, fields, start)
    pack, unpack = packer(block.Inputs, fields), unpacker(fields)
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
    options = {
        "StartTime": start,
        "StopTime": stop,
        "StepSize": STEP_SIZE,
        "RelTol": 1e-6,  # for the comparison: mathematical libraries differ in the last digit
        "OutputIntervalLength": STEP_SIZE,
    }
    return "".join(f"{name}, {value!r}\n" for name, value in options.items()).encode()


def _signals(name: str, inputs: list[Variable]) -> list[Signal]:
    """Return a signal per input: that of the FMU whose name this one's begins with, or its own."""
    known = SIGNALS.get(max((of for of in SIGNALS if name.startswith(of)), key=len, default=""), {})
    return [_signal(v, known.get(v.name)) for v in inputs]


def _signal(v: Variable, known: Signal | None) -> Signal:
    """Return the known signal, or one from the start out by the nominal value and back."""
    if v.kind is bool:
        return lambda _: bool(v.start)
    first, width = float(v.start or 0.0), v.nominal or 1.0
    signal = known or (lambda t: first + width * _rise(t, 0.0, 1.0) - width * _rise(t, 1.5, 2.5))
    # Rounded, as mathematical libraries differ; interpolation does not keep the sign of -0.0.
    return lambda t: round(signal(t), 9) + 0.0


def _rise(t: float, start: float, stop: float) -> float:
    """Rise from 0 at `start` to 1 at `stop`, level before and after."""
    s = min(max((t - start) / (stop - start), 0.0), 1.0)
    return s * s * (3.0 - 2.0 * s)


def _rate(t: float, start: float, stop: float) -> float:
    s = min(max((t - start) / (stop - start), 0.0), 1.0)
    return 6.0 * s * (1.0 - s) / (stop - start)


def _push(t: float, stop: float) -> float:
    """Push one way until half of `stop`, then the other: a body at rest is at rest again."""
    return math.sin(2.0 * math.pi * t / stop) if t < stop else 0.0


def _light(reflectance: float, gap: float) -> float:
    """Return the intensity in V that a sensor has over a gap in m."""
    return reflectance * 0.0024 / math.pow(0.005 + gap, 1.1506)


APPROACH: dict[str, Signal] = {
    "position[1]": lambda t: 0.11 - 0.045 * _rise(t, 0.0, 1.2),
    "position[2]": lambda t: -0.11 + 0.105 * _rise(t, 0.0, 1.8),
    "velocity[1]": lambda t: -0.045 * _rate(t, 0.0, 1.2),
    "velocity[2]": lambda t: 0.105 * _rate(t, 0.0, 1.8),
}
"""Both fingers up to an object, finger 1 first."""

SIGNALS: dict[str, dict[str, Signal]] = {
    # The fingers come near, touch gently one after the other, press, and let go.
    "GripperPlant": {
        "force[1]": lambda t: (
            -0.12 * _push(t, 1.0) - 0.1 * _rise(t, 0.9, 1.1)
            - 1.9 * _rise(t, 1.6, 1.9) + 2.2 * _rise(t, 2.3, 2.5)
        ),
        "force[2]": lambda t: (
            0.18 * _push(t, 1.3) + 0.1 * _rise(t, 1.2, 1.4)
            + 2.9 * _rise(t, 1.7, 2.0) - 3.2 * _rise(t, 2.4, 2.6)
        ),
    },
    # From far away until past the surface, and back.
    "ProximitySensor": {"gap": lambda t: 0.049 + 0.051 * math.cos(2.0 * math.pi * t / 3.0)},
    # An approach, and a surface that drifts away again, from finger 2 more.
    "GraspController": {
        **APPROACH,
        "intensity[1]": lambda t: (
            0.075 + 0.9 * _rise(t, 0.2, 1.2) - 0.3 * _rise(t, 2.0, 3.0)
        ),
        "intensity[2]": lambda t: (
            0.03 + 0.9 * _rise(t, 0.6, 1.8) - 0.6 * _rise(t, 2.2, 3.0)
        ),
    },
    # An approach to faces of two colours, of which it learns, and a grasp.
    "GraspControllerAdaptive": {
        **APPROACH,
        "intensity[1]": lambda t: _light(0.6, 0.045 - 0.045 * _rise(t, 0.0, 1.2)),
        "intensity[2]": lambda t: _light(1.0, 0.105 - 0.105 * _rise(t, 0.0, 1.8)),
    },
}  # fmt: skip
"""The signals of each FMU's inputs by name. A real input that is not here swings out and back."""
