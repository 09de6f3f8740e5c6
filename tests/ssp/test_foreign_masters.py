"""Our archive in the two C++ masters of PyPI, which find the same contacts; theirs here.

Both step all components with the values of the last communication point, as our Jacobi scheme does.
Each runs in a process of its own, where our Python FMUs find the Python they need.
"""

import importlib.util
import json
import subprocess
import sys
import zipfile
from ctypes.util import find_library
from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim import System, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.hil.served import Service
from grasp_cosim.ssp.to_archive import write_ssp
from ssp.hand_made import (
    archive,
    bind,
    component,
    connect,
    linear,
    mapping,
    parameter_set,
    structure,
    system,
)
from support.grasps import CASES
from support.marks import interop
from support.native_fmus import build_model, needs_gcc
from support.proxies import build_proxy, serving

STEP = 1e-3  # s
GAPS = ("plant.gap[1]", "plant.gap[2]")

ECOS = """
import json, sys
from ecospy import EcosSimulation
path, step, steps = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
with EcosSimulation(ssp_path=path, step_size=step) as simulation:
    simulation.init(parameter_set="initialValues")
    rows = []
    for _ in range(steps):
        simulation.step(1)
        rows.append([float(simulation.get_real(f"plant::gap[{j}]")) for j in (1, 2)])
json.dump(rows, open(sys.argv[4], "w"))
"""

COSIM = """
import json, sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
path, step, steps = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
execution = CosimExecution.from_ssp_file(path)
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
plant = execution.slave_index_from_instance_name("plant")
known = {v.name.decode(): v.reference for v in execution.slave_variables(plant)}
rows = []
for _ in range(steps):
    execution.step(1)
    rows.append(observer.last_real_values(plant, [known["gap[1]"], known["gap[2]"]]))
assert execution.status().current_time == steps * round(step * 1e9)
json.dump(rows, open(sys.argv[4], "w"))
"""


@pytest.fixture(scope="module", params=["python", interop("native"), interop("native proxy")])
def jacobi(request, tmp_path_factory):
    """A grasp that needs its values of all types and a transformation on a connection.

    Case 1, the object elsewhere, one side darker, the other sensor 1 mm behind its place.
    """
    folder = request.getfixturevalue("fmus" if request.param == "python" else "natives")
    grasp = System.load(SYSTEM, folder)
    connections = tuple(
        replace(connection, factor=1.0, offset=0.001)
        if connection.target.component == "sensor_2"
        else connection
        for connection in grasp.connections
    )
    values = {**CASES[1], "plant.initial_object_position": 0.02, "sensor_1.reflectance": 0.86}
    system = (
        replace(grasp, connections=connections)
        .with_values(values)
        .with_experiment(STEP, scheme="jacobi")
    )
    if request.param != "native proxy":
        yield system
        return
    fmu = system.component("plant", "test").fmu
    with serving(fmu, Service(lockstep=True)) as server:
        target = tmp_path_factory.mktemp("proxy") / "PlantBench.fmu"
        yield system.swap("plant", build_proxy(fmu, target, server.address[1]))


def gaps(program, path, system):
    """The two gaps at the steps after t = 0."""
    steps = system.stop_ns // system.step_ns
    found = path.parent / "gaps.json"
    command = [sys.executable, "-c", program, str(path), str(STEP), str(steps), str(found)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    return np.array(json.loads(found.read_text("utf-8")))


def first_contacts(rows):
    """For each finger the first step that ends with its gap closed."""
    assert (rows <= 0.0).any(axis=0).all()
    return [int(k) for k in (rows <= 0.0).argmax(axis=0)]


def check(theirs, system):
    result = simulate(system, engine="python")  # a peer may be a thread of this process
    ours = np.column_stack([result[name] for name in GAPS])[1:]
    assert ours.shape == theirs.shape
    pairs = zip(first_contacts(theirs), first_contacts(ours), strict=True)
    assert all(abs(a - b) <= 2 for a, b in pairs)
    np.testing.assert_allclose(theirs, ours, rtol=0.0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.skipif(not importlib.util.find_spec("ecospy"), reason="ecospy is not installed")
@pytest.mark.skipif(not find_library("tbb"), reason="libtbb12, which ecospy needs, is missing")
def test_ecos_finds_the_same_contacts(jacobi, tmp_path):
    path = tmp_path / "grasp.ssp"
    write_ssp(jacobi, path)
    check(gaps(ECOS, path, jacobi), jacobi)


def unpacked(system, folder):
    """The archive as libcosim takes it."""
    write_ssp(system, folder / "grasp.ssp")
    with zipfile.ZipFile(folder / "grasp.ssp") as file:
        file.extractall(folder / "unpacked")
    return folder / "unpacked"


needs_libcosim = pytest.mark.skipif(
    not importlib.util.find_spec("libcosimpy"), reason="libcosimpy is missing"
)


@pytest.mark.interop
@needs_libcosim
def test_libcosim_finds_the_same_contacts(jacobi, tmp_path):
    """In the step that our archive names for it."""
    check(gaps(COSIM, unpacked(jacobi, tmp_path), jacobi), jacobi)


@pytest.mark.interop
@needs_libcosim
def test_libcosim_takes_the_step_of_a_component(fmus, tmp_path):
    grasp = System.load(SYSTEM, fmus).with_experiment(STEP, 2.5, scheme="jacobi")
    parts = (
        replace(c, step_ns=5_000_000) if c.name == "controller" else c for c in grasp.components
    )
    own = replace(grasp, components=tuple(parts))
    check(gaps(COSIM, unpacked(own, tmp_path), own), own)


DECAY = "resources/dahlquist.fmu"
PACKAGE = "application/x-ssp-package"
RATE = 0.5  # 1/s


def inner():
    """A decay integrated here, whose rate is a parameter of the system."""
    parts = component(
        "decay", "parameter k; output x", source=DECAY, implementation="ModelExchange"
    )
    drawn = connect("rate", "decay/k", linear(0.001)) + connect("decay/x", "out")
    return structure(system("inside", parts, drawn, "parameter rate; output out"), "")


def outer():
    """It, and one that steps by itself and passes the other's output on, doubled, plus 1."""
    elements = component("sub", "output out Float64", source="resources/sub.ssp", type=PACKAGE)
    given = bind(parameter_set("d Real 1", units=""))
    elements += component("gate", "input u; output y Real", given, source=DECAY)
    values = bind(parameter_set("R Real 500", units=""), mapping(("R", "sub.rate", "")))
    top = system("top", elements, connect("sub/out", "gate/u", linear(2.0, 1.0)), "", values)
    return structure(top, '<ssd:DefaultExperiment stopTime="2"/>', version="2.0")


@pytest.fixture
def path(tmp_path):
    """An archive as others pack it, with models in C: nested, integrated here."""
    fmu = build_model("dahlquist", tmp_path).read_bytes()
    (tmp_path / "inner").mkdir()
    sub = archive(tmp_path / "inner", inner(), {}, {DECAY: fmu}).read_bytes()
    return archive(tmp_path, outer(), {}, {DECAY: fmu, "resources/sub.ssp": sub})


@pytest.mark.slow
@needs_gcc
def test_an_archive_of_others_follows_the_solution(path):
    result = simulate(System.load(path, step=0.01))
    expected = np.exp(-RATE * result.time)
    np.testing.assert_allclose(result["sub_decay.x"], expected, rtol=1e-6)
    passed = result["gate.y"] - result["gate.x"]  # y = x + d·u
    np.testing.assert_allclose(passed[1:], 2.0 * expected[1:] + 1.0, rtol=1e-6)


@pytest.mark.slow
@needs_gcc
def test_our_archive_of_it_runs_the_same(path, command):
    own = path.with_name("own.ssp")
    assert command("ssp", str(path), "-o", str(own), "--set", "experiment.step=0.01")[0] == 0
    with zipfile.ZipFile(own) as file:
        assert sum(name.endswith(".fmu") for name in file.namelist()) == 1
    first, second = simulate(System.load(path, step=0.01)), simulate(System.load(own))
    for name in first:
        assert second[name].tobytes() == first[name].tobytes(), name
    code, out, _ = command("run", str(own), "--json")
    assert (code, json.loads(out)["steps"]) == (0, 200)
