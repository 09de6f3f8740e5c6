"""qualify: what it prints and writes, its exit codes, its mistakes in one line."""

import json
import re
from pathlib import Path

import pytest
from grasp_cosim import cli
from grasp_cosim.comparison.bands import read_bands
from grasp_cosim.grasp.presets import SYSTEM

BEFORE = "high=1e3, tunable=True)\n    ] = (0.5, 0.5)"
SHORT = ["--stop", "0.05", *(
    word for place in ("experiment.step=1e-3", "components.plant.isolation=none")
    for word in ("--set", place)
)]  # fmt: skip


@pytest.fixture
def qualify(monkeypatch, capsys, grasp, tmp_path):
    """Runs the command in an empty folder; exit code, standard output, standard error."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.setattr("grasp_cosim.grasp.system.as_named", lambda: grasp)

    def run(*arguments):
        code = cli.main(["qualify", "--python", *map(str, arguments)])
        out, err = capsys.readouterr()
        return code, out, err

    return run


def test_a_copy_is_qualified(qualify, fmus):
    code, out, err = qualify(fmus / "GripperPlant.fmu", "--as", "plant", *SHORT)
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0] == (
        "QUALIFIED: GripperPlant.fmu as plant (now GripperPlant.fmu), "
        "0.05 s in steps of 1 ms, sequential"
    )
    assert re.fullmatch(
        r"0 of \d+ signals and 0 of 7 metrics out of band; nothing was touched until t = 0.05 s: "
        r"12 metrics have no value in either run: time_to_contact\[1\], .*",
        lines[1],
    )
    assert "interface: no difference" in lines


@pytest.mark.slow
def test_a_system_file_has_the_candidate_with_its_names_and_values(qualify, fmus, tmp_path):
    """A heavier finger, and gaps under other names: what the file says of it, and nothing else."""
    text = SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{fmus}/')
    path = tmp_path / "mine.toml"
    path.write_text(text.replace("object_width = 0.07,", '"finger_mass[2]" = 0.6,'), "utf-8")
    code, out, _ = qualify(path, "--as", "plant", *SHORT, "--json")
    report = json.loads(out)
    assert (code, report["qualified"]) == (1, False)
    outside = {s["name"] for s in report["signals"] if not s["inside"]}
    assert "plant.position[2]" in outside
    assert "plant.position[1]" not in outside
    path.write_text(text, "utf-8")
    assert qualify(path, "--as", "plant", *SHORT)[0] == 0
    path.write_text(text.replace("components.plant", "components.gripper"), "utf-8")
    code, _, err = qualify(path, "--as", "plant", *SHORT)
    assert code == 2
    assert err.count("\n") == 1


@pytest.mark.slow
def test_all_that_it_writes(qualify, altered):
    heavy = altered(
        "GripperPlant", "gripper_plant/fingers.py", BEFORE, BEFORE.replace("0.5)", "0.6)")
    )
    code, out, err = qualify(heavy, "--as", "plant", *SHORT, "-o", "page.html", "--json")
    report = json.loads(out)
    assert (code, report["qualified"], err) == (1, False, "wrote page.html\n")
    page = Path("page.html").read_text("utf-8")
    for text in ("NOT QUALIFIED", "finger_mass[2]: starts with 0.6 kg", "plant.position[2]"):
        assert text in page
    Path("used.json").write_text(out)
    bands = read_bands(Path("used.json"))
    assert set(bands.signals) == {s["name"] for s in report["signals"]}
    assert set(bands.metrics) == {m["name"] for m in report["metrics"]}


def test_a_candidate_that_does_not_fit_is_not_run_nor_drawn(qualify, fmus):
    Path("page.html").write_text("of an earlier one")
    code, out, err = qualify(fmus / "ProximitySensor.fmu", "--as", "plant", "-o", "page.html")
    assert (code, err) == (1, "no page page.html: there were no two runs\n")
    assert "not run, the interface does not fit: force[1], " in out
    assert not Path("page.html").exists()
