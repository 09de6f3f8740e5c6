"""What docs/results/tools.md says of other tools is what happens with them, where they are."""

import csv
import json
import os
import re
import shutil
from ctypes.util import find_library
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from grasp_cosim import System, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.ssp.to_archive import write_ssp
from support.foreign_tools import (
    COFMUPY,
    COSIM,
    ECOS,
    PYSSP_STANDARD,
    PYSSP_STANDARD_MAKES,
    call,
    deviations_from_fmpy,
    python_with,
    run_in,
    script_of,
)
from support.marks import interop, slow

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/results/tools.md").read_text("utf-8")
STEP = 1e-3  # s
FORCE = "plant.contact_force[1]"
PUSH = {"force[1]": -2.0, "force[2]": 2.0}  # N
BINARY, PUSHED = 2.0**-9, 0.5
"""s; a step that FMPy, which adds up, and we, who count nanoseconds, meet at the same times."""

Column = npt.NDArray[np.float64]


class Row(NamedTuple):
    """A row of the page: what is measured has as many digits as are printed."""

    tool: str
    version: str
    exchanged: str
    value: str
    deviation: str
    by: str


ROWS = [
    Row(*(cell.strip() for cell in line.strip("|").split("|")))
    for line in PAGE.splitlines()
    if line.count("|") == len(Row._fields) + 1 and "test_" in line
]


def row(name):
    """The row that the test of this name belongs to."""
    (found,) = (r for r in ROWS if f"`{name}`" in r.by)
    return found


def tool(name, *needed):
    """The Python with the tool of a row, and what it stands on there; else the test is skipped."""
    version, *others = row(name).version.split(", ")
    return python_with(row(name).tool, version, *needed, **dict(other.split() for other in others))


def kept(name, theirs, ours):
    """The last value is the page's, and no sample is farther from ours than it says."""
    assert theirs.shape == ours.shape
    assert f"{theirs[-1]:.4f}" in row(name).value.split()
    assert abs(theirs - ours).max() <= float(row(name).deviation.split()[0])


@pytest.fixture(scope="module")
def kinds(folder_of):
    """The folders of FMUs, by kind."""

    class Kinds(dict[str, Path]):
        def __missing__(self, kind):
            return folder_of(kind)  # type: ignore[arg-type]

    return Kinds()


ALL = ("python", "native", "native FMI 3")
every_kind = pytest.mark.parametrize("kind", [interop(kind) for kind in ALL])
of_fmi_2 = pytest.mark.parametrize("kind", [interop(kind) for kind in ALL[:2]])
by_fmpy = pytest.mark.parametrize(
    "kind", [slow(kind) if kind in ("python", "native") else interop(kind) for kind in ALL]
)
"""FMPy is there wherever we are."""


def grasp_of(folder):
    """The measured grasp, with the FMUs of a folder."""
    return System.load(SYSTEM, folder).with_experiment(STEP, stop=2.5, scheme="jacobi")


def force(system, signal=FORCE):
    return np.asarray(simulate(system, engine="python")[signal])


def pushed(fmu, folder):
    """The contact force of a plant alone, in our master."""
    values = "".join(f"{json.dumps(name)} = {value}\n" for name, value in PUSH.items())
    head = f"[experiment]\nstep = {BINARY}\nstop = {PUSHED}\n[components.plant]\nfmu = "
    path = folder / "pushed.toml"
    path.write_text(f"{head}{json.dumps(str(fmu))}\n[components.plant.values]\n{values}", "utf-8")
    return force(System.load(path))


def archived(system, folder):
    path = folder / "grasp.ssp"
    write_ssp(system, path)
    return path


def asked_of(system, **more):
    steps = system.stop_ns // system.step_ns
    return {"step": STEP, "steps": steps, "signals": [FORCE], **more}


def parts_of(system):
    ends = [(c.source, c.target) for c in system.connections]
    return {
        "fmus": {c.name: str(c.fmu) for c in system.components},
        "connections": [(*str(s).split(".", 1), *str(t).split(".", 1)) for s, t in ends],
    }


def found(python, program, folder, given):
    return np.array(run_in(python, program, folder, given))[:, 0]


# From us to them


@every_kind
@pytest.mark.skipif(not find_library("tbb"), reason="libtbb12, which ecospy needs, is missing")
def test_ecospy(kinds, kind, tmp_path):
    python = tool("test_ecospy")
    system = grasp_of(kinds[kind])
    given = asked_of(system, ssp=str(archived(system, tmp_path)))
    kept("test_ecospy", found(python, ECOS, tmp_path, given), force(system)[1:])


@of_fmi_2
def test_libcosimpy(kinds, kind, tmp_path):
    python = tool("test_libcosimpy")
    system = grasp_of(kinds[kind])
    given = asked_of(system, ssp=str(archived(system, tmp_path)))
    kept("test_libcosimpy", found(python, COSIM, tmp_path, given), force(system)[1:])


@pytest.mark.interop
def test_libcosimpy_knows_no_fmi_3(kinds, tmp_path):
    """Where it does, the page has one kind more to tell of."""
    python = tool("test_libcosimpy")
    system = grasp_of(kinds["native FMI 3"])
    given = asked_of(system, ssp=str(archived(system, tmp_path)))
    with pytest.raises(AssertionError, match=r"(?i)fmi"):
        run_in(python, COSIM, tmp_path, given)


@every_kind
def test_cofmupy(kinds, kind, tmp_path):
    python = tool("test_cofmupy")
    system = grasp_of(kinds[kind])
    start = simulate(system.with_experiment(stop=STEP))
    ends = [(c.source, c.target) for c in system.connections]
    inputs = {
        c.name: {t.variable: float(start[str(s)][0]) for s, t in ends if t.component == c.name}
        for c in system.components
    }
    given = asked_of(system, inputs=inputs, **parts_of(system))
    kept("test_cofmupy", found(python, COFMUPY, tmp_path, given), force(system)[1:])


@pytest.mark.interop
def test_cofmupy_fails_beside_our_fmpy(kinds, tmp_path):
    """Where it does not, the page has one row to tell less."""
    python = tool("test_cofmupy_fails_beside_our_fmpy")
    system = grasp_of(kinds["native"])
    given = asked_of(system, inputs={c.name: {} for c in system.components}, **parts_of(system))
    with pytest.raises(AssertionError, match="minimum"):
        found(python, COFMUPY, tmp_path, given)


@by_fmpy
def test_fmpy(kinds, kind, tmp_path):
    tool("test_fmpy")
    fmu = kinds[kind] / "GripperPlant.fmu"
    result = simulate_fmu(fmu, start_values=PUSH, stop_time=PUSHED, output_interval=BINARY)
    kept("test_fmpy", result["contact_force[1]"], pushed(fmu, tmp_path))


@by_fmpy
def test_fmpy_on_the_command_line(kinds, kind, tmp_path):
    python = tool("test_fmpy_on_the_command_line")
    fmu = kinds[kind] / "GripperPlant.fmu"
    words = [str(word) for pair in PUSH.items() for word in pair]
    times = ["--stop-time", str(PUSHED), "--output-interval", str(BINARY), "--validate"]
    start = ["--start-values", *words, "--output-file", "out.csv"]
    call([python, "-m", "fmpy", "simulate", str(fmu), *times, *start], tmp_path)
    with (tmp_path / "out.csv").open(encoding="utf-8", newline="") as file:
        column = np.array([float(r["contact_force[1]"]) for r in csv.DictReader(file)])
    kept("test_fmpy_on_the_command_line", column, pushed(fmu, tmp_path))


@by_fmpy
def test_fmpy_finds_no_problem(kinds, kind):
    tool("test_fmpy_finds_no_problem")
    shipped = sorted(kinds[kind].glob("*.fmu"))
    assert len(shipped) == int(row("test_fmpy_finds_no_problem").value.split()[0])
    assert [validate_fmu(fmu) for fmu in shipped] == [[]] * len(shipped)


@pytest.mark.interop
def test_pyssp_standard_reads(kinds, tmp_path):
    python = tool("test_pyssp_standard_reads")
    system = grasp_of(kinds["python"])
    given = {"ssp": str(archived(system, tmp_path))}
    connections, connectors = run_in(python, PYSSP_STANDARD, tmp_path, given)
    said = re.findall(r"\d+", row("test_pyssp_standard_reads").value)
    assert [connections, connectors] == [int(number) for number in said]
    assert connections == len(system.connections)


@every_kind
def test_fmutool(kinds, kind, tmp_path):
    python = tool("test_fmutool")
    for name in ("GripperPlant", "ProximitySensor", "GraspController"):
        fmu = kinds[kind] / f"{name}.fmu"
        said = call([script_of(python, "fmutool"), "-input", fmu, "-check"], tmp_path)
        fmi = 3 if kind == "native FMI 3" else 2
        assert f"This FMU seems to be compliant with FMI-{fmi}.0." in said
        assert f"No semantic error against the FMI-{fmi} standard." in said


# From them to us


@pytest.mark.parametrize("kind", [interop("python"), interop("native FMI 3")])
def test_pyssp_standard_writes(kinds, kind, tmp_path):
    python = tool("test_pyssp_standard_writes")
    path = archived(grasp_of(kinds[kind]), tmp_path)
    before = path.read_bytes()
    run_in(python, PYSSP_STANDARD, tmp_path, {"ssp": str(path)})
    assert path.read_bytes() != before
    kept("test_pyssp_standard_writes", force(System.load(path)), force(grasp_of(kinds[kind])))


@pytest.mark.parametrize("kind", [interop("python"), interop("native FMI 3")])
def test_pyssp_standard_makes(kinds, kind, tmp_path):
    python = tool("test_pyssp_standard_makes")
    system, path = grasp_of(kinds[kind]), tmp_path / "grasp.ssp"
    given = {"ssp": str(path), "stop": 2.5, **parts_of(system)}
    run_in(python, PYSSP_STANDARD_MAKES, tmp_path, given)
    theirs = System.load(path).with_experiment(STEP, scheme="jacobi")  # SSP names neither
    kept("test_pyssp_standard_makes", force(theirs), force(system))


SIDE = ("position", "velocity", "contact_force", "gap")


@pytest.mark.parametrize(
    ("kind", "version"),
    [
        interop("python", 2),
        interop("native", 2),
        interop("native FMI 3", 2),
        interop("native FMI 3", 3),
    ],
)
def test_fmucontainer(kinds, kind, version, tmp_path):
    """Plant and sensors in one container, which hands nothing on before its first step."""
    python = tool("test_fmucontainer")
    system = grasp_of(kinds[kind])
    start = simulate(system.with_experiment(stop=STEP))
    for name, fmu in {
        "plant": "GripperPlant",
        "1": "ProximitySensor",
        "2": "ProximitySensor",
    }.items():
        shutil.copy(kinds[kind] / f"{fmu}.fmu", tmp_path / f"{name}.fmu")
    fingers = ("1", "2")
    container = {
        "name": "bench.fmu", "step_size": STEP, "fmu": ["plant.fmu", "1.fmu", "2.fmu"],
        "link": [["plant.fmu", f"gap[{j}]", f"{j}.fmu", "gap"] for j in fingers],
        "start": [[f"{j}.fmu", "gap", float(start[f"plant.gap[{j}]"][0])] for j in fingers],
        "input": [[f"force[{j}]", "plant.fmu", f"force[{j}]"] for j in fingers],
        "output": [
            *(["plant.fmu", f"{n}[{j}]", f"{n}[{j}]"] for n in SIDE for j in fingers),
            *([f"{j}.fmu", "intensity", f"intensity[{j}]"] for j in fingers),
        ],
    }  # fmt: skip
    (tmp_path / "bench.json").write_text(json.dumps(container), "utf-8")
    options = ["-container", "bench.json", "-fmi", str(version), "-fmu-directory", "."]
    call([script_of(python, "fmucontainer"), *options], tmp_path)
    names = [f"{n}[{j}]" for n in ("position", "velocity", "intensity") for j in fingers]
    connections = [
        *(f"plant.{name} -> controller.{name}" for name in names),
        *(f"controller.force[{j}] -> plant.force[{j}]" for j in fingers),
    ]
    controller = json.dumps(str(kinds[kind] / "GraspController.fmu"))
    path = tmp_path / "loop.toml"
    path.write_text(
        f"connections = {json.dumps(connections)}\n"
        f'[experiment]\nstep = {STEP}\nstop = 2.5\nscheme = "jacobi"\n'
        f'[components.plant]\nfmu = "bench.fmu"\n[components.controller]\nfmu = {controller}\n',
        "utf-8",
    )
    kept("test_fmucontainer", force(System.load(path)), force(system))


SLAVE = """
from {package} import {fmi}Causality, {fmi}Slave, {real}, {whole}
class Spring({fmi}Slave):
    def __init__(self, **given):
        super().__init__(**given)
        self.u, self.k, self.x, self.v, self.n, self.time = 0.0, 4.0, 1.0, 0.0, 0, 0.0
        if "{fmi}" == "Fmi3":
            self.register_variable({real}("time", causality={fmi}Causality.independent))
        self.register_variable({real}("u", causality={fmi}Causality.input))
        self.register_variable({real}("x", causality={fmi}Causality.output))
        self.register_variable({whole}("n", causality={fmi}Causality.output))
    def do_step(self, now, step):
        self.v += step * (self.u - self.k * self.x)
        self.x += step * self.v
        self.n += 1
        return True
"""


def spring(u):
    """The slave's equations, in plain Python."""
    x, v, found = 1.0, 0.0, [1.0]
    for _ in range(100):
        v += 0.01 * (u - 4.0 * x)
        x += 0.01 * v
        found.append(x)
    return np.array(found)


def alone(fmu, folder, values, isolation="none"):
    path = folder / "alone.toml"
    text = f'[experiment]\nstep = 0.01\nstop = 1.0\n[components.it]\nfmu = "{fmu}"\n'
    path.write_text(f'{text}isolation = "{isolation}"\nvalues = {values}\n', "utf-8")
    return System.load(path)


@pytest.mark.parametrize(
    ("package", "fmi", "real", "whole"),
    [
        interop("pythonfmu", "Fmi2", "Real", "Integer"),
        interop("pythonfmu3", "Fmi3", "Float64", "Int32"),
    ],
)
def test_slave_of(package, fmi, real, whole, tmp_path):
    name = f"test_slave_of[{package}]"
    python = tool(name)
    names = {"package": package, "fmi": fmi, "real": real, "whole": whole}
    (tmp_path / f"{package}_spring.py").write_text(SLAVE.format(**names), "utf-8")
    call([script_of(python, package), "build", "-f", f"{package}_spring.py"], tmp_path)
    system = alone("Spring.fmu", tmp_path, "{ u = 0.5 }", "process")
    kept(name, force(system, "it.x"), spring(0.5))
    assert simulate(system)["it.n"][-1] == 100


ARRAYS = """
from pythonfmu3 import Dimension, Fmi3Causality as C, Fmi3Slave, Fmi3Variability as V, Float64
import numpy as np
class StateSpace(Fmi3Slave):
    def __init__(self, **given):
        super().__init__(**given)
        self.A, self.u, self.y, self.time = np.eye(3), np.ones(3), np.zeros(3), 0.0
        def put(name, shape):
            return lambda v: setattr(self, name, np.array(v).reshape(shape))
        sized = {"u": dict(dimensions=[Dimension(start="3")], setter=put("u", 3))}
        sized["A"] = dict(dimensions=[Dimension(start="3")] * 2, setter=put("A", (3, 3)))
        self.register_variable(Float64("time", causality=C.independent))
        parameter = dict(causality=C.parameter, variability=V.tunable)
        self.register_variable(Float64("A", **parameter, **sized["A"]))
        self.register_variable(Float64("u", causality=C.input, **sized["u"]))
        self.register_variable(Float64("y", causality=C.output, dimensions=[Dimension(start="3")]))
    def do_step(self, now, step):
        self.y = self.y + step * (self.A @ self.y + self.u)
        return True
"""


@pytest.mark.interop
def test_arrays_of_pythonfmu3(tmp_path):
    name = "test_arrays_of_pythonfmu3"
    python = tool(name, "numpy")
    (tmp_path / "pythonfmu3_arrays.py").write_text(ARRAYS, "utf-8")
    call([script_of(python, "pythonfmu3"), "build", "-f", "pythonfmu3_arrays.py"], tmp_path)
    u, a = [1.0, 0.5, 0.25], [-1.0, 0.5, 0.0, 0.0, -2.0, 0.0, 0.0, 0.0, -1.5]
    system = alone("StateSpace.fmu", tmp_path, f"{{ u = {u}, A = {a} }}", "process")
    x, expected = np.zeros(3), [0.0]
    for _ in range(100):
        x = x + 0.01 * (np.reshape(a, (3, 3)) @ x + np.array(u))
        expected.append(float(x[0]))
    kept(name, force(system, "it.y[1]"), np.array(expected))


BALL = """
from pythonfmu3 import Fmi3Causality as C, Fmi3Initial as I, Fmi3SlaveBase
from pythonfmu3 import Fmi3UpdateDiscreteStatesResult, Fmi3Variability as V, Float64, ModelExchange
class Ball(Fmi3SlaveBase, ModelExchange):
    def __init__(self, **given):
        super().__init__(**given)
        self.time, self.h, self.v = 0.0, 1.0, 0.0
        varies = dict(variability=V.continuous)
        local = dict(causality=C.local, **varies)
        state = dict(causality=C.output, initial=I.exact, **varies)
        self.register_variable(Float64("time", causality=C.independent, **varies))
        self.register_variable(Float64("h", **state))
        self.register_variable(Float64("der_h", derivative=1, getter=lambda: self.v, **local))
        self.register_variable(Float64("v", **state))
        self.register_variable(Float64("der_v", derivative=3, getter=lambda: -9.81, **local))
        height = Float64("z", getter=lambda: self.h, **local)
        self.register_variable(height, has_event_indicator=True)
    def get_continuous_state_derivatives(self):
        return [self.v, -9.81]
    def get_event_indicators(self):
        return [self.h]
    def update_discrete_states(self):
        result = Fmi3UpdateDiscreteStatesResult()
        if self.h <= 0.0 and self.v < 0.0:
            self.h, self.v = 1e-300, -0.7 * self.v
            result.valuesOfContinuousStatesChanged = True
        return result
"""


@pytest.mark.interop
def test_model_exchange_of_pythonfmu3(tmp_path):
    """A ball of 1 m, and its first bounce, against the solution in closed form."""
    name = "test_model_exchange_of_pythonfmu3"
    python = tool(name)
    (tmp_path / "pythonfmu3_ball.py").write_text(BALL, "utf-8")
    call([script_of(python, "pythonfmu3"), "build", "-f", "pythonfmu3_ball.py"], tmp_path)
    system = alone("Ball.fmu", tmp_path, "{}", "process")
    g, t = 9.81, np.arange(101) * 0.01
    first = (2.0 / g) ** 0.5
    later = t - first
    after = 0.7 * g * first * later - g * later**2 / 2.0
    kept(name, force(system, "it.h"), np.where(later < 0.0, 1.0 - g * t**2 / 2.0, after))


@pytest.mark.interop
def test_unifmu(tmp_path, monkeypatch):
    """Its example, an adder of all types in Python, which it runs in a process behind a socket."""
    python = tool("test_unifmu", "pyzmq", "toml")
    call([script_of(python, "unifmu"), "generate", "python", "Adder"], tmp_path)
    launch = tmp_path / "Adder/resources/launch.toml"
    launch.write_text(launch.read_text("utf-8").replace('"grpc"', '"zmq"', 1), "utf-8")
    shutil.make_archive(str(tmp_path / "Adder"), "zip", tmp_path / "Adder")
    (tmp_path / "Adder.zip").rename(tmp_path / "Adder.fmu")
    monkeypatch.setenv("PATH", f"{Path(python).parent}:{os.environ['PATH']}")
    values = (
        "{ real_a = 0.5, real_b = 3.0, integer_a = 2, integer_b = 3, boolean_a = true, "
        'boolean_b = false, string_a = "x", string_b = "y" }'
    )
    result = simulate(alone("Adder.fmu", tmp_path, values, "process").with_experiment(stop=0.1))
    kept("test_unifmu", np.asarray(result["it.real_c"])[1:], np.full(10, 3.5))
    assert (result["it.integer_c"][-1], result["it.string_c"][-1]) == (5, "xy")


@pytest.mark.parametrize("interface", [interop("CoSimulation"), interop("ModelExchange")])
def test_fmus_from_elsewhere(interface):
    """All FMUs below the folder GRASP_COSIM_FMUS that FMPy runs: the same values in our master."""
    folder = os.environ.get("GRASP_COSIM_FMUS")
    if not folder:
        pytest.skip("GRASP_COSIM_FMUS names no folder of FMUs")
    found = [deviations_from_fmpy(path) for path in sorted(Path(folder).rglob("*.fmu"))]
    ran = [deviations[interface] for deviations in found if interface in deviations]
    if not ran:
        pytest.skip(f"below GRASP_COSIM_FMUS there is none for {interface}")
    name = f"test_fmus_from_elsewhere[{interface}]"
    assert max(ran) <= float(row(name).deviation.split()[0])


# The page itself


def test_every_row_has_its_test_and_its_pinned_version():
    source = Path(__file__).read_text("utf-8")
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pins = dict(line.partition(";")[0].split("==") for line in lines)
    pinned = {name.lower().replace("_", "-"): version for name, version in pins.items()}
    assert len(ROWS) > 12
    for tool_name, version, _, _, _, by in ROWS:
        assert pinned.get(tool_name.lower(), version) == version, tool_name
        for test in re.findall(r"`(?:\S+/)?(test_\w+)", by):
            there = list((ROOT / "tests").rglob(f"{test}.py")) or f"def {test}(" in source
            assert there, test
