"""An FMU of somebody else in our master and in FMPy's simulate_fmu."""

import json
import tempfile
from pathlib import Path

import numpy as np
from fmpy import read_model_description, simulate_fmu
from grasp_cosim import System, simulate

REALS = ("Real", "Float64", "Float32")


def deviations_from_fmpy(fmu):
    """By interface, the largest difference of an output over 100 steps of its default experiment.

    Model exchange is integrated with a relative tolerance of 1e-10 by both. Without what FMPy does
    not run, either, and without FMI 1.0, which is not for us.
    """
    description = read_model_description(fmu, validate=False)
    interfaces = {
        "CoSimulation": description.coSimulation,
        "ModelExchange": description.modelExchange,
    }
    there = [
        name for name, found in interfaces.items() if found and description.fmiVersion[0] > "1"
    ]
    compared = {name: _deviation(fmu, description, name) for name in there}
    return {name: deviation for name, deviation in compared.items() if deviation is not None}


def _deviation(fmu, description, interface):
    default = description.defaultExperiment
    stop = float(default.stopTime) if default and default.stopTime else 1.0
    step = float(default.stepSize) if default and default.stepSize else stop / 100.0
    step, stop = round(step, 9), round(100 * step, 9)
    try:
        theirs = simulate_fmu(
            fmu, validate=False, stop_time=stop, output_interval=step, record_events=False,
            fmi_type=interface, relative_tolerance=1e-10,
        )  # fmt: skip
    except Exception:  # FMPy's own, and whatever the FMU does
        return None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "alone.toml")
        path.write_text(_system(fmu, description, interface, step, stop), "utf-8")
        ours = simulate(System.load(path))
    names = [n for n in theirs.dtype.names if f"it.{n}" in ours]
    assert names, fmu
    rows = min(len(theirs), len(ours.time))  # FMPy may be without the last, where an FMU ends it
    assert rows > 1
    pairs = [(np.asarray(ours[f"it.{n}"])[:rows], theirs[n][:rows]) for n in names]
    numbers = [(a, b) for a, b in pairs if a.dtype.kind in "fiub"]
    return max(float(np.abs(a.astype(float) - b.astype(float)).max()) for a, b in numbers)


def _system(fmu, description, interface, step, stop):
    values = {
        v.name: _start(v)
        for v in description.modelVariables
        if v.causality == "input" and v.type not in ("Clock", "Binary") and not v.dimensions
    }
    given = "".join(f"{json.dumps(n)} = {json.dumps(v)}\n" for n, v in values.items())
    solver = "solver = { relative_tolerance = 1e-10 }\n" if interface == "ModelExchange" else ""
    return (
        f"[experiment]\nstep = {step}\nstop = {stop}\n"
        f"[components.it]\nfmu = {json.dumps(str(fmu.resolve()))}\nisolation = 'process'\n{solver}"
        f"[components.it.values]\n{given}"
    )


def _start(variable):
    start = variable.start
    if variable.type == "Boolean":
        return start in ("true", "1", True)
    if variable.type == "String":
        return str(start or "")
    return float(start or 0.0) if variable.type in REALS else int(start or 0)
