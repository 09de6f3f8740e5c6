"""One master in its own process; started by masters.py, with that master's interpreter.

    worker.py MASTER FOLDER [CORE]

runs the grasp with the FMUs of FOLDER, on one core if that is given. It answers every number of
macro steps on standard input with the time they took, in s. It answers an empty line with the value
of plant.position[1]. Masters are in their own processes because their C++ libraries and their pins
of FMPy collide.

Every master runs the Jacobi scheme, the one they share, and records every output its own way.
"""

import dataclasses
import importlib
import os
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

STEP = 1e-4
"""The communication step, in s."""

LONG = 1000.0
"""s of simulated time that no measurement reaches."""

GRASP = tomllib.loads(
    (Path(__file__).parent.parent / "orchestrator/grasp_cosim/grasp/grasp.toml").read_text("utf-8")
)
COMPONENTS = {name: Path(c["fmu"]).stem for name, c in GRASP["components"].items()}
CONNECTIONS = [
    (*source.split(".", 1), *target.split(".", 1))
    for source, target in (text.split(" -> ") for text in GRASP["connections"])
]
"""The components by their models; source, output, target, input."""


class Master(NamedTuple):
    """A master that is ready to step."""

    advance: Callable[[int], object]
    """Does so many macro steps, recording included."""
    position: Callable[[], float]
    """plant.position[1] as reached, in m."""


def descriptions(folder: Path) -> dict[str, list[Any]]:
    """The variables of each component, as FMPy reads them."""
    read = importlib.import_module("fmpy").read_model_description
    return {name: read(folder / f"{fmu}.fmu").modelVariables for name, fmu in COMPONENTS.items()}


def ours(folder: Path, engine: str, **more: Any) -> Master:
    """grasp-cosim; every output in memory."""
    grasp_cosim, system = _system(folder)
    how = {"step": STEP, "stop": LONG, "scheme": "jacobi", "engine": engine, **more}
    session = grasp_cosim.simulate.session(system, **how)
    return Master(session.step, lambda: session["plant.position[1]"])


def _system(folder: Path) -> tuple[Any, Any]:
    """The package, which may be an earlier one, and the grasp of the FMUs of a folder as they are.

    It has no metrics, which some runs would keep every row for.
    """
    grasp_cosim = importlib.import_module("grasp_cosim")
    presets = importlib.import_module("grasp_cosim.grasp.presets")
    system = grasp_cosim.System.load(presets.SYSTEM, folder)
    if hasattr(system, "natively"):
        system = system.natively(False)
    if hasattr(system, "metrics"):
        system = dataclasses.replace(system, metrics=())
    return grasp_cosim, system


def bare(folder: Path) -> Master:
    """The blocks as one program of plain C; every output in memory."""
    _, system = _system(folder)
    scratch = Path(tempfile.mkdtemp(dir=os.environ["TMPDIR"]))
    program = importlib.import_module("bare").bare_program(system, STEP, scratch)
    kept = []
    place = program.outputs.index("plant.position[1]")
    return Master(
        lambda steps: kept.append(program.advance(steps)), lambda: float(kept[-1][-1, place])
    )


def ecospy(folder: Path) -> Master:
    """ecospy; every output by its CSV writer, the only recording it has."""
    ecos = importlib.import_module("ecospy")
    structure = ecos.EcosSimulationStructure()
    for name, fmu in COMPONENTS.items():
        structure.add_model(name, str(folder / f"{fmu}.fmu"))
    for source, output, target, given in CONNECTIONS:
        structure.make_real_connection(f"{source}::{output}", f"{target}::{given}")
    simulation = ecos.EcosSimulation(structure=structure, step_size=STEP)
    table = os.path.join(tempfile.mkdtemp(dir=os.environ["TMPDIR"]), "ecospy.csv")  # noqa: PTH118
    described = descriptions(folder).items()
    outputs = [(name, v) for name, of in described for v in of if v.causality == "output"]
    names = [f"{name}::{v.name}" for name, v in outputs]
    simulation.add_csv_writer(table, identifiers=names)
    if not simulation.init():
        raise RuntimeError(ecos.EcosLib.get_last_error())
    return Master(simulation.step, lambda: float(simulation.get_real("plant::position[1]")))


def libcosimpy(folder: Path) -> Master:
    """libcosimpy; every real output by its time series observer, in memory. It has no Booleans."""
    logging, enums, executions, observers, slaves = (
        importlib.import_module(f"libcosimpy.Cosim{name}")
        for name in ("Logging", "Enums", "Execution", "Observer", "Slave")
    )
    logging.log_output_level(logging.CosimLogLevel.WARNING)
    execution = executions.CosimExecution.from_step_size(round(STEP * 1e9))
    described = descriptions(folder)
    index = {
        name: execution.add_local_slave(slaves.CosimLocalSlave(str(folder / f"{fmu}.fmu"), name))
        for name, fmu in COMPONENTS.items()
    }
    references = {
        name: {v.name: v.valueReference for v in variables} for name, variables in described.items()
    }
    for source, output, target, given in CONNECTIONS:
        execution.connect_real_variables(
            *(index[source], references[source][output]),
            *(index[target], references[target][given]),
        )
    observer = observers.CosimObserver.create_time_series()
    execution.add_observer(observer)
    real = enums.CosimVariableType.REAL
    for name, variables in described.items():
        for v in variables:
            if v.causality == "output" and v.type == "Real":
                observer.start_time_series(index[name], v.valueReference, real)
    last = observers.CosimObserver.create_last_value()
    watched = references["plant"]["position[1]"]

    def position() -> float:
        """From its own observer, so that it costs nothing before."""
        execution.add_observer(last)
        execution.step(1)
        return float(last.last_real_values(index["plant"], [watched])[0])

    return Master(execution.step, position)


def cofmupy(folder: Path) -> Master:
    """cofmupy; every real output in its results in memory.

    It reads Booleans with fmi2GetReal, which an FMU may refuse and ours do: the Boolean outputs
    are taken out of the descriptions it read. That is less work, not more.
    """
    wrappers: Any = importlib.import_module("cofmupy.wrappers")
    read = wrappers.read_model_description

    def without_boolean_outputs(path: str) -> Any:
        description, unread = read(path), ("output", "Boolean")
        variables = description.modelVariables
        description.modelVariables = [v for v in variables if (v.causality, v.type) != unread]
        return description

    wrappers.read_model_description = without_boolean_outputs
    coordinator = importlib.import_module("cofmupy").Coordinator()
    fmus = []
    for name, variables in descriptions(folder).items():
        start = {v.name: float(v.start) for v in variables if v.causality == "input"}
        path = str(folder / f"{COMPONENTS[name]}.fmu")
        fmus.append({"id": name, "path": path, "name": name, "initialization": start})
    connections = []
    for source, output, target, given in CONNECTIONS:
        ends = {"source": (source, output), "target": (target, given)}
        connections.append({k: {"id": c, "variable": v} for k, (c, v) in ends.items()})
    how = {"root": "", "cosim_method": "jacobi", "iterative": False}
    coordinator.start({**how, "fmus": fmus, "connections": connections})

    def advance(steps: int) -> None:
        for _ in range(steps):
            coordinator.do_step(STEP)

    return Master(advance, lambda: float(coordinator.get_variable(("plant", "position[1]"))[0]))


MASTERS: dict[str, Callable[[Path], Master]] = {
    "bare C": bare,
    "grasp-cosim unrecorded": lambda folder: ours(folder, "compiled", every=10**9),
    "grasp-cosim before": lambda folder: ours(folder, "compiled"),
    "grasp-cosim compiled": lambda folder: ours(folder, "compiled"),
    "grasp-cosim python": lambda folder: ours(folder, "python"),
    "ecospy": ecospy,
    "libcosimpy": libcosimpy,
    "cofmupy": cofmupy,
}


def main() -> None:
    """Answer on the standard output as it was; what a master prints goes to standard error."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    if sys.argv[3:] and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {int(sys.argv[3])})
    master = MASTERS[sys.argv[1]](Path(sys.argv[2]))
    for line in sys.stdin:
        if not line.strip():
            print(master.position(), file=answers)
            continue
        start = time.perf_counter()
        master.advance(int(line))
        print(time.perf_counter() - start, file=answers)


if __name__ == "__main__":
    main()
