"""An FMU of somebody else in our master and in FMPy's simulate_fmu."""

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import read_model_description, simulate_fmu
from grasp_cosim import System, simulate

REALS = ("Real", "Float64", "Float32")


def deviation_from_fmpy(fmu: Path) -> float | None:
    """The largest difference of an output over 100 steps; None where FMPy does not run it, either.

    Steps are those of its default experiment. FMUs of FMI 1.0, which are not for us, count as None.
    """
    description = read_model_description(fmu, validate=False)
    if description.fmiVersion == "1.0":
        return None
    default = description.defaultExperiment
    stop = float(default.stopTime) if default and default.stopTime else 1.0
    step = float(default.stepSize) if default and default.stepSize else stop / 100.0
    step, stop = round(step, 9), round(100 * step, 9)
    values = {
        v.name: _start(v)
        for v in description.modelVariables
        if v.causality == "input" and v.type not in ("Clock", "Binary") and not v.dimensions
    }
    given = "".join(f"{json.dumps(n)} = {json.dumps(v)}\n" for n, v in values.items())
    text = f"[experiment]\nstep = {step}\nstop = {stop}\n[components.it]\nisolation = 'process'\n"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "alone.toml")
        path.write_text(
            f"{text}fmu = {json.dumps(str(fmu.resolve()))}\n[components.it.values]\n{given}",
            "utf-8",
        )
        try:
            theirs = simulate_fmu(
                fmu, validate=False, stop_time=stop, output_interval=step, record_events=False
            )
        except Exception:  # FMPy's own, and whatever the FMU does
            return None
        ours = simulate(System.load(path))
    names = [n for n in theirs.dtype.names if f"it.{n}" in ours]
    assert names, fmu
    pairs = [(np.asarray(ours[f"it.{n}"]), theirs[n]) for n in names]
    return max(
        float(np.abs(a.astype(float) - b.astype(float)).max())
        for a, b in pairs
        if a.dtype != object
    )


def _start(variable: Any) -> float | int | bool | str:
    start = variable.start
    if variable.type == "Boolean":
        return start in ("true", "1", True)
    if variable.type == "String":
        return str(start or "")
    return float(start or 0.0) if variable.type in REALS else int(start or 0)
