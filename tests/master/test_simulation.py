"""Runs of the built-in grasp through FMUs."""

import os
import pty
import re
import select
import signal
import subprocess
import sys
import tempfile
import termios
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import InputError, SimulationError, simulate
from grasp_cosim.grasp.presets import SYSTEM
from support.marks import needs_pythonfmu

SHORT = 0.05


def test_every_output_is_recorded_with_its_unit(grasp):
    result = simulate(grasp, stop=SHORT)
    outputs = {
        f"{c.name}.{v.name}": v.unit for c in grasp.components for v in c.interface.of("output")
    } | {f"plant.exchange_energy[{j}]": "J" for j in (1, 2)}
    assert dict(result.units) == outputs
    assert set(result) == set(outputs)
    assert all(len(result[name]) == len(result.time) == 501 for name in outputs)
    assert result["plant.contact[1]"].dtype == bool


def test_nothing_jumps_at_the_start(grasp):
    """The virtual objects start where the fingers are measured, wherever the FMUs' inputs start."""
    moved = grasp.with_values(
        {"plant.initial_position[1]": 0.15, "plant.initial_position[2]": -0.1}
    )
    result = simulate(moved, stop=SHORT)
    assert result["controller.virtual_position[1]"][0] == 0.15
    assert result["controller.virtual_position[2]"][0] == -0.1
    assert result["controller.target_position"][0] == pytest.approx(0.025, abs=1e-15)
    for j in (1, 2):
        assert np.abs(np.diff(result[f"controller.force[{j}]"])).max() < 0.02


def test_a_refused_parameter_is_one_line_with_the_reason(grasp):
    wide = grasp.with_values({"plant.object_width": 0.5})
    with pytest.raises(
        InputError, match=r"^plant: GripperPlant.fmu refused .*object_width = 0.5 m"
    ):
        simulate(wide, stop=SHORT)


GAP = "l = 0.0 if u.gap < 0.0 else u.gap"


def test_an_fmu_that_fails_on_the_way_leaves_what_was_recorded(grasp, altered):
    trap = f"if u.gap < 0.044:\n        raise RuntimeError('the lamp is broken')\n    {GAP}"
    fmu = altered("ProximitySensor", "proximity_sensor/optics.py", GAP, trap)
    with pytest.raises(
        SimulationError, match=r"^sensor_1: .*fatal at t = .*lamp is broken"
    ) as caught:
        simulate(grasp.swap("sensor_1", fmu))
    result = caught.value.result
    assert not result.complete
    assert len(result.time) > 100
    assert result["plant.gap[1]"][-1] == pytest.approx(0.044, abs=1e-5)
    assert "\n" not in str(caught.value)
    assert "Traceback" in "".join(caught.value.__notes__)  # for --debug
    assert simulate(grasp, stop=1e-3).complete  # the process is well


@needs_pythonfmu
@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux which libraries are loaded")
def test_a_python_fmu_that_refuses_a_step_says_why_and_is_freed(grasp):
    """pythonfmu answers fmi2Fatal, after which FMI forbids to free it: ours outlives that."""
    before = Path("/proc/self/maps").read_text().count("GripperPlant.so")
    reason = r"^plant: \S+ returned fatal at t = 0 s: step of 20\.0 s: must be at most \S+ s "
    for _ in range(3):
        with pytest.raises(SimulationError, match=reason):
            simulate(grasp.with_experiment(step=20.0, stop=40.0))
    assert Path("/proc/self/maps").read_text().count("GripperPlant.so") == before


def test_nothing_stays_in_the_temporary_folder_or_on_the_path(grasp, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    before = sys.path.copy()
    simulate(grasp, stop=1e-3)
    with pytest.raises(InputError):
        simulate(grasp.with_values({"plant.object_width": 0.5}), stop=1e-3)
    assert list(tmp_path.iterdir()) == []
    assert sys.path == before


@needs_pythonfmu
def test_a_temporary_folder_that_crashes_pythonfmu_is_refused(grasp, unpack_in):
    folder = unpack_in("a+b")
    with pytest.raises(InputError, match="set TMPDIR to a folder of plain ASCII letters"):
        simulate(grasp, stop=1e-3)
    assert list(folder.iterdir()) == []


def test_a_temporary_folder_with_a_space_is_fine(grasp, unpack_in):
    unpack_in("a b")
    assert simulate(grasp, stop=1e-3).complete


@pytest.mark.slow
@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_keeps_what_was_recorded(fmus, tmp_path):
    """On a terminal there is a progress bar; Ctrl-C is sent once it has begun to move."""
    terminal, side = pty.openpty()
    termios.tcsetwinsize(side, (24, 100))
    system = str(system_file(fmus, tmp_path))
    options = ["--stop", "1000", "--out", str(tmp_path / "out"), "--json"]
    with subprocess.Popen(
        [sys.executable, "-m", "grasp_cosim", "run", system, *options],
        stdout=subprocess.PIPE,
        stderr=side,
        text=True,
    ) as process:
        os.close(side)
        seen = b""
        while not re.search(rb"[1-9]\d* of 1000\.00 s", seen):
            assert select.select([terminal], [], [], 30.0)[0], "no progress for 30 s"
            seen += os.read(terminal, 4096)
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=60)
    os.close(terminal)
    assert process.returncode == 130
    assert '"complete": false' in out
    lines = (tmp_path / "out" / "signals.csv").read_text().splitlines()
    assert len(lines) > 1000
    assert len(lines[-1].split(",")) == len(lines[0].split(","))


def system_file(fmus, folder):
    """The built-in system as a user's own file beside its FMUs."""
    path = folder / "mine.toml"
    text = SYSTEM.read_text("utf-8")
    for name in ("GripperPlant", "ProximitySensor", "GraspController"):
        text = text.replace(f'"{name}.fmu"', f'"{fmus / name}.fmu"')
    path.write_text(text, encoding="utf-8")
    return path
