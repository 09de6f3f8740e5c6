"""What a command writes goes into a pipe, through a link, and never in the place of a folder."""

import os
from pathlib import Path
from threading import Thread

import pytest
from grasp_cosim import simulate

WRITERS = {
    "comparison.html": ("compare", "run", "run", "-o"),
    "grasp.ssp": ("ssp", "-o"),
    "proxy.fmu": ("proxy", "GripperPlant.fmu", "-o"),
    "report.html": ("report", "run", "--out"),
    "table.csv": ("sweep", "--set", "experiment.stop=0.01", "--set", "experiment.step=1e-3",
                  "--vary", "plant.object_width=0.04,0.05", "--workers", "1", "--out"),
    "qualification.html": ("qualify", "GripperPlant.fmu", "--as", "plant", "--step", "1e-3",
                           "--stop", "0.05", "-o"),
    "system.toml": ("init", "--force"),
}  # fmt: skip
SLOW = ("qualification.html",)
EACH = pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.slow if n in SLOW else ()) for n in WRITERS],
)


@pytest.fixture
def here(grasp, fmus, tmp_path):
    result = simulate(grasp, step=1e-3, stop=0.01)
    (tmp_path / "run").mkdir()
    result.to_json(tmp_path / "run" / "run.json")
    result.to_csv(tmp_path / "run" / "signals.csv")
    (tmp_path / "GripperPlant.fmu").write_bytes((fmus / "GripperPlant.fmu").read_bytes())
    return tmp_path


@EACH
def test_a_pipe_has_its_reader_get_it(name, command, here):
    pipe = here / name
    os.mkfifo(pipe)
    found = []
    reader = Thread(target=lambda: found.append(pipe.read_bytes()), daemon=True)
    reader.start()
    code, _, err = command(*WRITERS[name], name)
    assert code == 0, err
    reader.join(10.0)
    assert len(found[0]) > 100
    assert pipe.is_fifo()


@EACH
def test_a_link_stays(name, command, here):
    (here / "other").mkdir()
    (here / name).symlink_to(Path("other") / f"own_{name}")
    code, _, err = command(*WRITERS[name], name)
    assert code == 0, err
    assert (here / name).is_symlink()
    assert (here / "other" / f"own_{name}").stat().st_size > 100


@EACH
def test_a_folder_is_refused(name, command, here):
    (here / name).mkdir()
    code, out, err = command(*WRITERS[name], name)
    assert (code, out) == (2, ""), err
    assert f"{name}: is a folder; must be" in err.splitlines()[-1]
    assert list((here / name).iterdir()) == []


def test_fmus_are_built_through_links(command, here):
    (here / "out").mkdir()
    (here / "out" / "GripperPlant.fmu").symlink_to(Path("..") / "mine.fmu")
    assert command("build", "--out", "out")[0] == 0
    assert (here / "out" / "GripperPlant.fmu").is_symlink()
    assert (here / "mine.fmu").read_bytes() == (here / "GripperPlant.fmu").read_bytes()


def test_a_run_is_not_written_in_the_place_of_a_file(command, here):
    (here / "file").touch()
    code, out, err = command("run", "--stop", "0.01", "--out", "file")
    assert (code, out) == (2, "")
    assert err == f"grasp-cosim: file: cannot write to {here}/file: Not a directory\n"


def test_the_files_of_a_run_go_through_links_and_pipes(command, here):
    folder, found = here / "run", []
    (folder / "signals.csv").unlink()
    os.mkfifo(folder / "signals.csv")
    (folder / "run.json").rename(here / "own.json")
    (folder / "run.json").symlink_to(Path("..") / "own.json")
    reader = Thread(target=lambda: found.append((folder / "signals.csv").read_bytes()), daemon=True)
    reader.start()
    code, _, err = command("run", "--stop", "0.02", "--out", "run")
    assert code == 0, err
    reader.join(10.0)
    assert found[0].count(b"\n") == 202
    assert (folder / "run.json").is_symlink()
    assert '"steps": 200,' in (here / "own.json").read_text()
