"""GripperPlantMuJoCo.fmu: what it refuses, and what works without MuJoCo."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import Load
from support.fmi2 import OK, Instance

NAME = "GripperPlantMuJoCo"
MISSING = (
    "mujoco is not installed, it computes this plant; "
    "install it with: pip install 'grasp-cosim[mujoco]'"
)


@pytest.mark.parametrize(
    ("force", "size", "reason"),
    [
        (0.0, 20.0, "must be at most 0.2 s"),
        (-1e300, 1e-3, "finger 1 could go 2e+293 m within a timestep of MuJoCo: must be at most "
         "fingertip_radius, 0.005 m"),
    ],
)  # fmt: skip
def test_a_step_that_mujoco_cannot_take_is_discarded(
    load: Load, force: float, size: float, reason: str
) -> None:
    """With the block's own reason, and the instance goes on."""
    with Instance(load(NAME)).initialise() as instance:
        assert instance.set({"force[1]": force}) == OK
        assert instance.step(0.0, size) == instance.fmu.discarded
        assert [message.text for message in instance.log] == [
            f"instance, t = 0 s: step of {size} s: {reason}"
        ]
        assert instance.set({"force[1]": -1.0}) == OK
        assert instance.step(0.0, 1e-3) == OK
        assert instance.get("velocity[1]") == pytest.approx([-0.002])


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """Of a Python without MuJoCo, and of all that it starts."""
    (tmp_path / "none").mkdir()
    text = "raise ModuleNotFoundError(\"No module named 'mujoco'\", name='mujoco')\n"
    (tmp_path / "none" / "mujoco.py").write_text(text)
    path = [str(tmp_path / "none"), *sys.path]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path)}


def command(tmp_path: Path, environment: dict[str, str], *arguments: object) -> tuple[int, str]:
    """Exit code and all that a command of ours says."""
    done = subprocess.run(
        [sys.executable, "-m", "grasp_cosim", *map(str, arguments)],
        cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    return done.returncode, done.stdout


@pytest.mark.slow
def test_without_mujoco_the_same_is_built(
    fmus: Path, tmp_path: Path, environment: dict[str, str]
) -> None:
    code, said = command(tmp_path, environment, "build", "--out", "built")
    assert code == 0, said
    built = {file.name: file.read_bytes() for file in (tmp_path / "built").iterdir()}
    assert built == {file.name: file.read_bytes() for file in fmus.iterdir()}
    assert f"{NAME}.fmu" in built


@pytest.mark.slow
def test_without_mujoco_a_run_says_in_one_line_what_is_missing(
    fmus: Path, tmp_path: Path, environment: dict[str, str]
) -> None:
    fmu = fmus / f"{NAME}.fmu"
    code, said = command(tmp_path, environment, "run", "--swap", f"plant={fmu}", "--stop", "0.01")
    assert code == 2
    assert said.splitlines()[-1] == f"grasp-cosim: plant: {fmu} does not load: {MISSING}"
    assert "Traceback" not in said


@pytest.mark.slow
def test_without_mujoco_doctor_gives_the_reason_and_the_fix(
    fmus: Path, tmp_path: Path, environment: dict[str, str]
) -> None:
    code, said = command(tmp_path, environment, "doctor", fmus / f"{NAME}.fmu")
    assert code == 1
    (trial,) = re.findall(r"^problem +trial +(.*)$", said, re.MULTILINE)
    assert trial == f"does not instantiate: {MISSING}"


@pytest.mark.slow
def test_without_mujoco_the_interface_is_shown(
    fmus: Path, tmp_path: Path, environment: dict[str, str]
) -> None:
    code, said = command(tmp_path, environment, "inspect", fmus / f"{NAME}.fmu")
    assert code == 0
    assert re.search(r"^contact_time_constant +parameter", said, re.MULTILINE)
