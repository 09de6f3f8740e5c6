"""Qualifications with C FMUs: other units, FMI 3.0, another name, a crash, a rejected step."""

from pathlib import Path

import pytest
from grasp_cosim import System
from grasp_cosim.study.qualify import qualify
from native_fmus import build, needs_gcc

pytestmark = needs_gcc

UNITS = {"x": "m", "u_Real": "N", "y_Real": "N"}


@pytest.fixture
def loop(tmp_path: Path) -> System:
    """x' = 3·x, from x = 1e-3: the spring's force is that of its input, with a bias of 1 N."""
    build(tmp_path, "plant", "2.0", UNITS)
    build(tmp_path, "spring", "2.0", {"u_Real": "m", "y_Real": "N"})
    inputs = ", ".join(
        f"{name} = {value}"
        for name, value in (
            ("u_Integer", "0"), ("u_Boolean", "false"), ("u_Enumeration", "1"), ("u_String", '"a"'),
        )
    )  # fmt: skip
    (tmp_path / "loop.toml").write_text(
        "wires = [\n"
        '  "plant.x -> spring.u_Real",\n'
        '  { from = "spring.y_Real", to = "plant.u_Real", factor = -1.0, offset = 1.0 },\n]\n'
        "[experiment]\nstep = 0.01\nstop = 1.0\n"
        f'[components.plant]\nfmu = "plant.fmu"\nvalues = {{ gain = 3.0, {inputs} }}\n'
        f'[components.spring]\nfmu = "spring.fmu"\nvalues = {{ {inputs} }}\n'
    )
    return System.load(tmp_path / "loop.toml")


def test_the_loop_approaches_its_bias(loop: System, tmp_path: Path) -> None:
    found = qualify(loop, "plant", tmp_path / "plant.fmu", isolation="none")
    assert found.qualified
    x = found.runs[0]["plant.x"].values
    assert x[-1] == pytest.approx(1.0 - 0.97**100, rel=1e-9)  # explicit Euler, as the FMU has it


def test_millimetres_are_converted_on_the_wire_and_back(loop: System, tmp_path: Path) -> None:
    """The candidate integrates 1000 times as much, in mm: the same motion."""
    candidate = build(tmp_path, "millimetres", "2.0", {**UNITS, "x": "mm"})
    same = qualify(loop, "plant", candidate, isolation="none")
    assert [(d.severity, d.kind, d.variable) for d in same.swap.differences] == [
        ("warns", "unit", "x")
    ]
    assert not same.qualified  # it integrates in m, and calls that mm
    values = same.runs[1]["plant.x"].values
    assert values[1] == pytest.approx(0.03e-3, rel=1e-12)
    right = qualify(loop, "plant", scaled(candidate, tmp_path / "scaled.fmu"), isolation="none")
    assert right.qualified


def scaled(fmu: Path, path: Path) -> Path:
    raise NotImplementedError
