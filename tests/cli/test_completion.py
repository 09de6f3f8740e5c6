"""What the shell completes: commands, options, and names of the system that is run."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.shell_completion import ShellComplete
from grasp_cosim.cli.group import cli


def completed(*words: str) -> list[str]:
    """What may stand in the place of the last word."""
    found = ShellComplete(cli, {}, "grasp-cosim", "_").get_completions([*words[:-1]], words[-1])
    return [item.value for item in found]


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("r",), ["relay", "report", "run"]),
        (("qual",), ["qualify"]),
        (("run", "--sch"), ["--scheme"]),
        (("run", "--scheme", "j"), ["jacobi"]),
        (("run", "--preset", "b"), ["bench"]),
        (("qualify", "--as", "sensor"), ["sensor_1", "sensor_2"]),
        (("run", "--swap", "pl"), ["plant="]),
        (("run", "--set", "plant.object"), ["plant.object_width="]),
        (("run", "--set", "plant.gap"), []),  # an output
        (("sweep", "reflectance"), ["reflectance_map", "reflectance"]),  # the latter of files
    ],
)
@pytest.mark.usefixtures("fmus")
def test_what_fits_is_completed(words: tuple[str, ...], found: list[str]) -> None:
    assert completed(*words) == found


def test_names_are_those_of_the_system_that_is_named(tmp_path: Path, fmus: Path) -> None:
    path = tmp_path / "eye.toml"
    path.write_text(
        "connections = []\n[experiment]\nstep = 1e-3\nstop = 1.0\n"
        f'[components.eye]\nfmu = "{fmus / "ProximitySensor.fmu"}"\nvalues = {{ gap = 0.1 }}\n'
        "[presets.dim]\n"
    )
    assert completed("run", str(path), "--set", "eye.refl") == ["eye.reflectance="]
    assert completed("run", str(path), "--preset", "d") == ["dim"]
    path.write_text("this is no system")
    assert completed("run", str(path), "--set", "eye.refl") == []


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_for_a_shell_is_printed(shell: str) -> None:
    done = asked({"_GRASP_COSIM_COMPLETE": f"{shell}_source"})
    assert (done.returncode, done.stderr) == (0, "")
    assert "_grasp_cosim_completion" in done.stdout


def test_the_command_answers_a_shell() -> None:
    """As the script for bash asks."""
    words = {"COMP_WORDS": "grasp-cosim qual", "COMP_CWORD": "1"}
    done = asked({"_GRASP_COSIM_COMPLETE": "bash_complete", **words})
    assert (done.returncode, done.stdout, done.stderr) == (0, "plain,qualify\n", "")


def asked(by: dict[str, str]) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-P", "-m", "grasp_cosim"]
    return subprocess.run(command, env=os.environ | by, capture_output=True, text=True, check=False)
