"""An archive as others pack it, with models in C: nested, integrated here, against the solution."""

import json
import zipfile

import numpy as np
import pytest
from grasp_cosim import System, simulate
from grasp_cosim.cli import main
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
from support.native_fmus import build_model, needs_gcc

pytestmark = [needs_gcc, pytest.mark.slow]

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
    fmu = build_model("dahlquist", tmp_path).read_bytes()
    (tmp_path / "inner").mkdir()
    sub = archive(tmp_path / "inner", inner(), {}, {DECAY: fmu}).read_bytes()
    return archive(tmp_path, outer(), {}, {DECAY: fmu, "resources/sub.ssp": sub})


def test_it_follows_the_solution(path):
    result = simulate(System.load(path, step=0.01))
    expected = np.exp(-RATE * result.time)
    np.testing.assert_allclose(result["sub_decay.x"], expected, rtol=1e-6)
    passed = result["gate.y"] - result["gate.x"]  # y = x + d·u
    np.testing.assert_allclose(passed[1:], 2.0 * expected[1:] + 1.0, rtol=1e-6)


def test_our_archive_of_it_runs_the_same(path, capsys):
    own = path.with_name("own.ssp")
    assert main(["ssp", str(path), "-o", str(own), "--set", "experiment.step=0.01"]) == 0
    with zipfile.ZipFile(own) as file:
        assert sum(name.endswith(".fmu") for name in file.namelist()) == 1
    first, second = simulate(System.load(path, step=0.01)), simulate(System.load(own))
    for name in first:
        assert second[name].tobytes() == first[name].tobytes(), name
    capsys.readouterr()
    assert main(["run", str(own), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["steps"] == 200
