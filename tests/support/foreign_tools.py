"""Other tools that load or make FMUs and archives: where they are, and how they are run.

Each runs in a process of its own, in the first Python that has it: that of the tests, or one of
those that the environment variable GRASP_COSIM_TOOLS lists, for tools that pin what is newer here.
"""

import json
import os
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from grasp_cosim import System, simulate

ECOS = """
from ecospy import EcosSimulation
with EcosSimulation(ssp_path=given["ssp"], step_size=given["step"]) as simulation:
    simulation.init(parameter_set="initialValues")
    for _ in range(given["steps"]):
        simulation.step(1)
        names = [name.replace(".", "::", 1) for name in given["signals"]]
        found.append([float(simulation.get_real(name)) for name in names])
"""

COSIM = """
import zipfile
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
folder = given["ssp"] + "_unpacked"
with zipfile.ZipFile(given["ssp"]) as archive:
    archive.extractall(folder)
execution = CosimExecution.from_ssp_file(folder, round(given["step"] * 1e9))
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
plant = execution.slave_index_from_instance_name("plant")
known = {"plant." + v.name.decode(): v.reference for v in execution.slave_variables(plant)}
for _ in range(given["steps"]):
    execution.step(1)
    found.append(observer.last_real_values(plant, [known[name] for name in given["signals"]]))
"""

COFMUPY = """
import cofmupy.wrappers
read = cofmupy.wrappers.read_model_description
def without_boolean_outputs(path):
    description = read(path)
    description.modelVariables = [
        v for v in description.modelVariables if (v.causality, v.type) != ("output", "Boolean")
    ]
    return description
cofmupy.wrappers.read_model_description = without_boolean_outputs
coordinator = cofmupy.Coordinator()
coordinator.start({
    "root": "", "cosim_method": "jacobi", "iterative": False,
    "fmus": [
        {"id": n, "path": p, "name": n, "initialization": given["inputs"][n]}
        for n, p in given["fmus"].items()
    ],
    "connections": [
        {"source": {"id": a, "variable": b}, "target": {"id": c, "variable": d}}
        for a, b, c, d in given["connections"]
    ],
})
for _ in range(given["steps"]):
    coordinator.do_step(given["step"])
    names = [tuple(name.split(".", 1)) for name in given["signals"]]
    found.append([float(coordinator.get_variable(name)[0]) for name in names])
"""
"""It reads Booleans as reals, which FMUs may refuse: those outputs are taken out. It passes nothing
before the first step: inputs are given the values that they have there."""

PYSSP_STANDARD = """
from pyssp_standard import SSP
with SSP(given["ssp"]) as archive, archive.system_structure as system:
    found[:] = [len(system.list_connections()), sum(map(len, system.list_connectors().values()))]
"""
"""It writes the file that it has opened."""

PYSSP_STANDARD_MAKES = """
from pathlib import Path
from pyssp_standard import SSP
from pyssp_standard.ssd import Component, Connection, Connector, DefaultExperiment, System
with SSP(Path(given["ssp"]), mode="w") as archive:
    for fmu in given["fmus"].values():
        archive.add_resource(Path(fmu), overwrite=True)
    with archive.system_structure as ssd:
        ssd.name, ssd.version, ssd.system = "grasp", "1.0", System(name="grasp")
        ssd.default_experiment = DefaultExperiment()
        ssd.default_experiment.start_time, ssd.default_experiment.stop_time = 0.0, given["stop"]
        for name, fmu in given["fmus"].items():
            component = Component()
            component.name, component.source = name, "resources/" + Path(fmu).name
            component.component_type = "application/x-fmu-sharedlibrary"
            ends = {(e[1], "output") for e in given["connections"] if e[0] == name}
            ends |= {(e[3], "input") for e in given["connections"] if e[2] == name}
            component.connectors = [Connector(name=n, kind=k) for n, k in sorted(ends)]
            ssd.system.elements.append(component)
        for a, b, c, d in given["connections"]:
            ends = dict(start_element=a, start_connector=b, end_element=c, end_connector=d)
            ssd.add_connection(Connection(**ends))
"""

_FRAME = """
import json, sys
given, found = json.load(open(sys.argv[1])), []
{program}
json.dump(found, open(sys.argv[2], "w"))
"""


@cache
def _version(python, distribution):
    code = "import sys, importlib.metadata as m; print(m.version(sys.argv[1]))"
    command = [python, "-c", code, distribution]
    done = subprocess.run(command, capture_output=True, text=True)
    return None if done.returncode else done.stdout.strip()


def python_with(distribution, version, *needed, **versions):
    """The Python that has it in this version and what else is needed; else the test is skipped.

    `versions` are those of other distributions that must be there.
    """
    pythons = [sys.executable, *filter(None, os.environ.get("GRASP_COSIM_TOOLS", "").split(":"))]
    there = [p for p in pythons if _version(p, distribution)]
    if not there:
        pytest.skip(f"{distribution} is not installed; GRASP_COSIM_TOOLS may name a Python with it")
    exact = {distribution: version, **versions}
    for python in there:
        if all(_version(python, n) == v for n, v in exact.items()) and all(
            _version(python, n) for n in needed
        ):
            return python
    has = ", ".join(str(_version(p, distribution)) for p in there)
    needs = "".join(f", with {name}" for name in (*map(" ".join, versions.items()), *needed))
    pytest.skip(f"{distribution} is {has}; the page tells of {version}{needs}")


def run_in(python, program, folder, given):
    """What the program found with what it was given."""
    asked, answer = folder / "given.json", folder / "found.json"
    asked.write_text(json.dumps(given), "utf-8")
    call([python, "-c", _FRAME.format(program=program), str(asked), str(answer)], folder)
    return json.loads(answer.read_text("utf-8"))


def call(command, folder):
    """What a command prints that must end well, in the folder."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def script_of(python, name):
    """A command that was installed with a Python's packages."""
    return Path(python).parent / name


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
