"""The built-in system, its FMUs in the user's cache, and the controllers of ours by their laws."""

import json
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from grasp_cosim import grasp_system
from grasp_cosim.fmu_export import build as builds
from grasp_cosim.fmu_export.build import shipped_fmus
from grasp_cosim.fmu_export.shipped import SHIPPED
from grasp_cosim.grasp.presets import SYSTEM, with_preset
from grasp_cosim.grasp.system import CONTROLLERS, with_controller
from support.marks import skip_without_pythonfmu

EIGHT_THREADS = """
from concurrent.futures import ThreadPoolExecutor
from grasp_cosim import grasp_system

with ThreadPoolExecutor(8) as pool:
    made = list(pool.map(lambda _: grasp_system(native=False), range(8)))
print(len({c.fmu.parent for system in made for c in system.components}))
"""


@pytest.fixture
def empty(tmp_path, monkeypatch):
    """An empty current folder, and an empty cache beside it."""
    skip_without_pythonfmu()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    return here


@pytest.mark.slow
def test_the_first_build_may_be_asked_for_by_many_threads_and_processes(empty):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", EIGHT_THREADS]
    processes = [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    assert [process.communicate()[0] for process in processes] == ["1\n", "1\n"]
    assert len(list(Path(os.environ["XDG_CACHE_HOME"], "grasp-cosim/fmus").iterdir())) == 1
    assert list(empty.iterdir()) == []


def test_where_nothing_can_be_kept_one_line_says_so_and_threads_share_it(
    empty, monkeypatch, caplog
):
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    monkeypatch.setattr(builds, "_until_the_end", {})
    of_the_grasp = {name: shipped for name, shipped in SHIPPED.items() if not shipped.of_hand}
    monkeypatch.setattr(builds, "SHIPPED", of_the_grasp)
    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(lambda _: grasp_system(native=False), range(8)))
    assert len({c.fmu.parent for system in made for c in system.components}) == 1
    assert caplog.messages == [
        "/dev/null/grasp-cosim: cannot be written to, so each process builds the FMUs; "
        "XDG_CACHE_HOME names another"
    ]
    assert list(empty.iterdir()) == []


ADAPTIVE = "GraspControllerAdaptive.fmu"


def fmus_of(system):
    return {c.name: c.fmu.name for c in system.components}


@pytest.fixture
def brain(fmus, tmp_path):
    """A system file in which the component brain plays the controller."""
    text = SYSTEM.read_text("utf-8").partition("# Cases of the paper")[0]
    for place in ('"{}.', "-> {}.", "components.{}]"):
        text = text.replace(place.format("controller"), place.format("brain"))
    text = text.replace('fmu = "', f'fmu = "{fmus}/')
    path = tmp_path / "brain.toml"
    path.write_text(f'{text}\n[roles]\ncontroller = "brain"\n', "utf-8")
    return path


def test_the_law_takes_the_place_of_the_controller_alone(grasp):
    adaptive = with_controller(grasp, "adaptive")
    assert fmus_of(adaptive) == {**fmus_of(grasp), "controller": ADAPTIVE}
    assert with_controller(adaptive, "published") == grasp == with_controller(grasp, "published")
    assert {f for law in CONTROLLERS for f in fmus_of(with_controller(grasp, law)).values()} > {
        *(f"GraspController{law}.fmu" for law in CONTROLLERS.values())
    }


def test_what_the_system_says_of_its_controller_stays(grasp):
    given = with_preset(grasp, "case_1").with_values({"controller.contact_force.stiffness": 49.0})
    adaptive = with_controller(given, "adaptive")
    assert adaptive.component("controller", "test").values == {
        "simultaneous_contact.enabled": False,
        "impact_reduction.enabled": True,
        "contact_force.stiffness": 49.0,
    }
    learning = adaptive.with_values({"controller.hold.squeeze": 0.2})
    note = with_controller(learning, "published").notes[-1]
    assert "has no parameter hold.squeeze: its value 0.2 is left out" in note


def test_one_that_is_not_beside_the_other_is_that_of_the_cache(grasp, tmp_path):
    own = tmp_path / "mine.fmu"
    shutil.copy(grasp.component("controller", "test").fmu, own)
    mine = with_controller(grasp.swap("controller", own), "adaptive")
    assert mine.component("controller", "test").fmu == shipped_fmus() / ADAPTIVE
    shutil.copy(grasp.component("controller", "test").fmu.with_name(ADAPTIVE), tmp_path)
    mine = with_controller(grasp.swap("controller", own), "adaptive")
    assert mine.component("controller", "test").fmu == tmp_path / ADAPTIVE


def test_run_goes_by_the_role_and_says_which_it_was(command, brain, tmp_path):
    arguments = ("--controller", "adaptive", "--case", "1", "--stop", "0.01", "--step", "1e-3")
    assert command("run", brain, *arguments, "--out", "out")[0] == 0
    made = json.loads((tmp_path / "out/run.json").read_text("utf-8"))["components"]
    assert made["brain"]["fmu"] == ADAPTIVE
    assert made["brain"]["values"]["simultaneous_contact.enabled"] is False
