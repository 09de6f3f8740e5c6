"""Native FMUs in programs for Windows that are not ours, under wine: ecos, and FMPy's server.

Both come with the packages ecospy and FMPy, for all platforms.
"""

import csv
import importlib.util
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from fmpy.util import add_remoting, read_csv
from grasp_cosim import System, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.ssp.write import write_ssp
from grasp_fmus.native.build import build_native, planned
from grasp_fmus.native.targets import WINDOWS
from support.compilers import needs_zig
from support.platforms import needs_programs, windows

pytestmark = [pytest.mark.slow, needs_programs("wine"), needs_zig]

NAMES = ("GraspController", "GripperPlant", "GripperPlantMovable", "ProximitySensor")


@pytest.fixture(scope="module")
def natives_of_windows(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of native FMUs that have a binary for Windows, too."""
    folder = tmp_path_factory.mktemp("windows")
    build_native(folder, planned([WINDOWS]), NAMES)
    return folder


def extracted(archive: Path, folder: Path) -> Path:
    with ZipFile(archive) as file:
        file.extractall(folder)
    return folder


# ecos, with an archive of the whole grasp

STEP = 1e-4
DIGITS = 0.6e-6
"""What ecos rounds to in its table, and a little."""

UNZIP = "@echo off\r\nxcopy /E /I /Y /Q %2.d %4\r\n"
"""ecos has a program unzip unpack, which wine has not: what was unpacked is copied."""

SAMPLED = ("plant.", "controller.target_position", "controller.virtual_position")
"""What a master that steps all at once has at the same points as ours."""


@pytest.mark.skipif(not importlib.util.find_spec("ecospy"), reason="NO ecospy")
def test_ecos_runs_the_grasp(natives_of_windows: Path, tmp_path: Path) -> None:
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
        cwd=tmp_path, env=windows(), capture_output=True, text=True, timeout=300,
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


def table(path: Path) -> Mapping[str, np.ndarray]:
    """The columns of a table of ecos, by our names of variables."""
    with path.open(newline="") as file:
        head, *rows = csv.reader(file, skipinitialspace=True)
    columns = np.array([row[2:] for row in rows], dtype=np.float64).T
    names = [name.rpartition("[")[0].replace("::", ".") for name in head[2:]]
    return dict(zip(names, columns, strict=True))


# FMPy, which has its server load the library

CROSS_CHECK = """
import sys
import numpy as np
from fmpy import read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.util import read_csv
folder, inputs, out = sys.argv[1:]
description = read_model_description(folder)
vrs = {v.name: v.valueReference for v in description.modelVariables}
outputs = [v for v in description.modelVariables if v.causality == "output" and v.type == "Real"]
signals = read_csv(inputs)
given = [n for n in signals.dtype.names if n != "time"]
fmu = FMU2Slave(guid=description.guid, unzipDirectory=folder, instanceName="remote",
                modelIdentifier=description.coSimulation.modelIdentifier)
fmu.instantiate()
fmu.setupExperiment()
fmu.enterInitializationMode()
rows = []
for k, row in enumerate(signals):
    if k:
        h = row["time"] - signals[k - 1]["time"]
        fmu.doStep(signals[k - 1]["time"], h)
    else:
        fmu.setReal([vrs[n] for n in given], [row[n] for n in given])
        fmu.exitInitializationMode()
    rows.append(fmu.getReal([v.valueReference for v in outputs]))
    fmu.setReal([vrs[n] for n in given], [row[n] for n in given])
fmu.terminate()
fmu.freeInstance()
np.savez(out, **dict(zip([v.name for v in outputs], np.array(rows).T)))
"""


def test_fmpy_runs_the_cross_check_through_its_server(
    natives_of_windows: Path, tmp_path: Path
) -> None:
    """One after the other: the server has one port. The client would end it too early in wine."""
    for name in NAMES:
        folder = extracted(natives_of_windows / f"{name}.fmu", tmp_path / name)
        shutil.rmtree(folder / "binaries" / "linux64")
        add_remoting(str(folder), "linux64", "win64")
        inputs, out = natives_of_windows / f"{name}_in.csv", tmp_path / f"{name}.npz"
        binaries = folder / "binaries" / "win64"
        command = [
            *map(str, (binaries / "server_tcp.exe", binaries / f"{name}.dll")),
            "/no/such/lock",
        ]
        said = tmp_path / "said"
        with said.open("wb") as file:
            server = subprocess.Popen(["wine", *command], env=windows(), stdout=file)
        try:
            wait_for("Starting RPC server", said)
            subprocess.run(
                [sys.executable, "-c", CROSS_CHECK, folder, inputs, out],
                stdout=subprocess.DEVNULL, check=True, timeout=120,
            )  # fmt: skip
        finally:
            server.kill()
            server.wait()
        reference, found = read_csv(natives_of_windows / f"{name}_ref.csv"), np.load(out)
        assert found.files
        for column in found.files:
            far = np.max(np.abs(found[column] - reference[column]))
            assert far <= (1e-10 if "force" in column else 1e-12), (name, column)


def wait_for(text: str, file: Path) -> None:
    end = time.monotonic() + 60.0
    while text not in file.read_text("utf-8", "replace"):
        assert time.monotonic() < end, file.read_text("utf-8", "replace")
        time.sleep(0.05)
    time.sleep(0.5)  # it says so before it listens
