"""The wheel works by itself, outside the repository, in an empty folder."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

pytestmark = pytest.mark.slow


def python(*arguments, cwd, path=None):
    environment = {**os.environ, "PYTHONPATH": str(path)} if path else dict(os.environ)
    done = subprocess.run(
        [sys.executable, *arguments], cwd=cwd, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_wheel_runs_in_an_empty_folder(tmp_path):
    dist, site, empty = tmp_path / "dist", tmp_path / "site", tmp_path / "empty"
    empty.mkdir()
    build = f"import hatchling.build; hatchling.build.build_wheel({str(dist)!r})"
    python("-c", build, cwd=ROOT)
    (wheel,) = dist.glob("*.whl")
    pip = ("-m", "pip", "install", "-q", "--no-deps", "--no-index", "--no-compile")
    python(*pip, "--target", str(site), str(wheel), cwd=empty)
    find = "from importlib.util import find_spec; print(find_spec('grasp_cosim').origin)"
    where = python("-c", find, cwd=empty, path=site)
    assert Path(where.strip()).is_relative_to(site)
    run = ("run", "--stop", "0.2", "--out", "results", "--json")
    out = python("-m", "grasp_cosim", *run, cwd=empty, path=site)
    assert json.loads(out)["steps"] == 2000
    python("-m", "grasp_cosim", "report", "results", cwd=empty, path=site)
    assert (empty / "results/report.html").read_text("utf-8").endswith("</html>\n")
    init = ("init", "mine/my_system.toml")
    python("-m", "grasp_cosim", *init, cwd=empty, path=site)
    (empty / "mine").rename(empty / "moved")
    mine = ("run", "moved/my_system.toml", "--stop", "0.2", "--out", "own", "--json")
    python("-m", "grasp_cosim", *mine, cwd=empty, path=site)
    own, built_in = (empty / folder / "signals.csv" for folder in ("own", "results"))
    assert own.read_bytes() == built_in.read_bytes()
    if shutil.which("gcc"):
        native = ("build", "--native", "GripperPlant", "--out", "native")
        python("-m", "grasp_cosim", *native, cwd=empty, path=site)
        assert (empty / "native/GripperPlant.fmu").is_file()
        alone = ("build", "--native", "--c-only", "c", "GraspController")
        python("-m", "grasp_cosim", *alone, cwd=empty, path=site)
        assert (empty / "c/arithmetic.h").is_file()
    assert {p.name for p in site.iterdir() if p.is_dir() and "-" not in p.name} == {
        "bin", "block_variables", "c_compilers", "grasp_cosim", "grasp_controller", "grasp_fmus",
        "gripper_plant", "proximity_sensor", "one_piece", "si_units",
    }  # fmt: skip
