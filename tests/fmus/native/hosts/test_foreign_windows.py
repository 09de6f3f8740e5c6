"""Native FMUs in a program for Windows that is not ours, under wine: ecos, which ecospy brings."""

import csv
import importlib.util
import subprocess
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from grasp_cosim import System, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.ssp.to_archive import write_ssp
from grasp_fmus.build import build_native, planned
from grasp_fmus.native.targets import WINDOWS
from support.marks import needs_zig
from support.platforms import needs_programs, windows

pytestmark = [pytest.mark.platforms, needs_programs("wine"), needs_zig]

NAMES = ("GraspController", "GripperPlant", "GripperPlantMovable", "ProximitySensor")


@pytest.fixture(scope="module")
def natives_of_windows(tmp_path_factory):
    """The folder of native FMUs that have a binary for Windows, too."""
    folder = tmp_path_factory.mktemp("windows")
    build_native(folder, planned([WINDOWS]), NAMES)
    return folder


def extracted(archive, folder):
    with ZipFile(archive) as file:
        file.extractall(folder)
    return folder


STEP = 1e-4
DIGITS = 0.6e-6
"""What ecos rounds to in its table, and a little."""

UNZIP = "@echo off\r\nxcopy /E /I /Y /Q %2.d %4\r\n"
"""Where SHELL is bash, ecos calls unzip, which wine lacks: this copies what was unpacked before."""

SAMPLED = ("plant.", "controller.target_position", "controller.virtual_position")
"""What a master that steps all at once has at the same points as ours."""


@pytest.mark.skipif(not importlib.util.find_spec("ecospy"), reason="NO ecospy")
def test_ecos_runs_the_grasp(natives_of_windows, tmp_path):
    system = (
        System.load(SYSTEM, natives_of_windows)
        .with_experiment(STEP, scheme="jacobi")
        .with_values({"plant.initial_object_position": 0.02, "sensor_1.reflectance": 0.86})
    )
    path = tmp_path / "grasp.ssp"
    write_ssp(system, path)
    folder = extracted(path, tmp_path / "grasp.ssp.d")
    for fmu in [*folder.glob("resources/*.fmu")]:
        extracted(fmu, fmu.with_name(f"{fmu.name}.d"))
    (tmp_path / "unzip.bat").write_bytes(UNZIP.encode())
    spec = importlib.util.find_spec("ecospy")
    assert spec is not None
    assert spec.origin is not None
    program = Path(spec.origin).with_name("binaries") / "ecos.exe"
    options = ["--stopTime", "3", "--stepSize", repr(STEP), "--parameterSet", "initialValues"]
    done = subprocess.run(
        ["wine", program, "simulate", "--path", f"Z:{path}", *options],
        cwd=tmp_path, env=windows() | {"SHELL": "/bin/bash"}, capture_output=True, text=True,
        timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    theirs = table(tmp_path / "grasp.csv")
    ours = simulate(system)
    names = [name for name in ours.units if name.startswith(SAMPLED) and name in theirs]
    assert len(names) > 12
    for name in names:
        found = np.asarray(ours[name], dtype=np.float64)[: len(theirs[name])]
        assert np.max(np.abs(theirs[name] - found)) <= DIGITS, name
    assert {len(column) for column in theirs.values()} == {30_000}
    assert theirs["plant.contact[1]"][-1] == theirs["plant.contact[2]"][-1] == 1.0


def table(path):
    """The columns of a table of ecos, by our names of variables."""
    with path.open(newline="") as file:
        head, *rows = csv.reader(file, skipinitialspace=True)
    columns = np.array([row[2:] for row in rows], dtype=np.float64).T
    names = [name.rpartition("[")[0].replace("::", ".") for name in head[2:]]
    return dict(zip(names, columns, strict=True))
