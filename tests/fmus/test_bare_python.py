"""The FMUs need a Python and nothing else: no package of ours, none of anybody, any version."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from grasp_controller import adaptive, series
from gripper_plant import compliant, movable, rigid
from proximity_sensor import channel
from support.pythons import VERSIONS, python
from support.slow import slow

HOST = Path(__file__).with_name("bare_host.py")
STEPS, H = 50, 1e-3


class Case(NamedTuple):
    """A block and inputs that make something happen within the steps."""

    block: Any
    inputs: Any


NEAR = series.Inputs(position=(0.09, -0.1), velocity=(-0.1, 0.2), intensity=(0.05, 0.04))
CASES = {
    "GripperPlant": Case(rigid, rigid.Inputs(force=(-60.0, 45.0))),  # both fingers hit the object
    "GripperPlantCompliant": Case(compliant, compliant.Inputs(force=(-60.0, 45.0))),
    "GripperPlantMovable": Case(movable, movable.Inputs(force=(-60.0, 45.0))),
    "ProximitySensor": Case(channel, channel.Inputs(gap=0.0123)),
    "GraspController": Case(series, NEAR),
    "GraspControllerAdaptive": Case(adaptive, NEAR),
}


def flat(values: Any) -> dict[str, float]:
    """A NamedTuple by the names of FMI variables."""
    named: dict[str, float] = {}
    for field, value in values._asdict().items():
        if isinstance(value, tuple):
            named |= {f"{field}[{i + 1}]": float(v) for i, v in enumerate(value)}
        else:
            named[field] = float(value)
    return named


def without_fmu(case: Case) -> dict[str, list[str]]:
    """The outputs of the block after each step, as bare_host.py prints them."""
    block, u = case
    params = block.Params()
    state = block.initial_state(params, u)
    rows = []
    for _ in range(STEPS):
        state = block.step(params, state, u, H)
        rows.append(flat(block.outputs(params, state, u)))
    return {name: [row[name].hex() for row in rows] for name in rows[0]}


@pytest.mark.slow
@pytest.mark.parametrize("version", [VERSIONS[0], *map(slow, VERSIONS[1:])])
def test_runs_where_nothing_is_installed(fmus: Path, tmp_path: Path, version: str) -> None:
    """Bit for bit what the block gives, in every version the same."""
    venv = tmp_path / "venv"
    create = [python(version).program, "-m", "venv", "--without-pip", str(venv)]
    subprocess.run(create, check=True, cwd=tmp_path, env={"PATH": "/usr/bin:/bin"})
    host = shutil.copy(HOST, tmp_path)
    for name, case in CASES.items():
        request = {"set": flat(case.inputs), "steps": STEPS, "step_size": H}
        done = subprocess.run(
            [venv / "bin/python", "-I", host, fmus / f"{name}.fmu", tmp_path / name,
             json.dumps(request)],
            cwd=tmp_path, env={"PATH": "/usr/bin:/bin"}, capture_output=True, text=True,
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, ""), f"{name} in Python {version}"
        report = json.loads(done.stdout)
        assert report["outputs"] == without_fmu(case), f"{name} in Python {version}"
        assert report["messages"] == []
        packed = [m for m in report["modules"] if Path(m).is_relative_to(tmp_path / name)]
        assert packed
        standard = Path(report["standard_library"]).resolve()
        foreign = [
            module
            for module in set(report["modules"]) - {*packed, str(host)}
            if not Path(module).is_relative_to(standard) or "site-packages" in module
        ]
        assert foreign == []


@pytest.mark.parametrize("name", CASES)
def test_something_happens_within_the_steps(name: str) -> None:
    """The comparison above would see a difference."""
    outputs = without_fmu(CASES[name])
    assert any(value != (0.0).hex() for values in outputs.values() for value in values)
    if name.startswith("GripperPlant"):
        assert all(outputs[f"contact[{j}]"][-1] == (1.0).hex() for j in (1, 2))
