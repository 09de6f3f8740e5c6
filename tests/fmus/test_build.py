"""Packing: reproducible, left alone when nothing changed, no name shared between two builds."""

import shutil
import zipfile
from pathlib import Path

import pytest
from conftest import Altered
from fmpy import simulate_fmu
from grasp_fmus import build as builder

NAMES = ["GraspController.fmu", "GripperPlant.fmu", "ProximitySensor.fmu"]


def test_builds_the_three_fmus(fmus: Path) -> None:
    assert sorted(path.name for path in fmus.iterdir()) == NAMES


def test_two_builds_give_the_same_bytes(fmus: Path, tmp_path: Path) -> None:
    for path in builder.build(tmp_path):
        assert path.read_bytes() == (fmus / path.name).read_bytes()


def test_an_fmu_with_the_same_content_is_left_alone(fmus: Path, tmp_path: Path) -> None:
    for name in NAMES:
        shutil.copy(fmus / name, tmp_path)
    before = {p.name: p.stat().st_mtime_ns for p in tmp_path.iterdir()}
    builder.build(tmp_path)
    assert {p.name: p.stat().st_mtime_ns for p in tmp_path.iterdir()} == before


def test_a_damaged_fmu_is_built_again(fmus: Path, tmp_path: Path) -> None:
    (tmp_path / "ProximitySensor.fmu").write_bytes(b"half of an archi")
    builder.build(tmp_path)
    assert zipfile.is_zipfile(tmp_path / "ProximitySensor.fmu")
    assert sorted(path.name for path in tmp_path.iterdir()) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_every_module_of_ours_carries_the_content_hash(fmus: Path, name: str) -> None:
    with zipfile.ZipFile(fmus / name) as archive:
        script = archive.read("resources/slavemodule.txt").decode()
        content = script.rpartition("_")[2]
        packed = {n.split("/")[1] for n in archive.namelist() if n.startswith("resources/")}
    assert len(content) == 16
    assert all(
        name.removesuffix(".py").endswith(f"_{content}")
        for name in packed - {"pythonfmu", "slavemodule.txt"}
    )


def test_two_builds_of_one_fmu_in_one_process_run_their_own_code(
    fmus: Path, altered: Altered
) -> None:
    other = altered(
        "ProximitySensor", "proximity_sensor/optics.py", "p.gain * p.ref", "2.0 * p.gain * p.ref"
    )
    once = simulate_fmu(fmus / "ProximitySensor.fmu", stop_time=0.001)
    twice = simulate_fmu(other, stop_time=0.001)
    again = simulate_fmu(fmus / "ProximitySensor.fmu", stop_time=0.001)
    assert twice["intensity"][-1] == 2.0 * once["intensity"][-1]
    assert again["intensity"][-1] == once["intensity"][-1]
