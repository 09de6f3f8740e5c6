"""The wheel works with nothing but what it asks for, in an empty folder, without a network."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import zipfile
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest
from support.pages import BLOCKS, INDENTED, commands_of, fill_in

ROOT = Path(__file__).parent.parent

pytestmark = pytest.mark.slow


def asked_for(names):
    """The distributions of these names and of what they ask for, without extras."""
    found, names = {}, [*names]
    while names:
        line = names.pop()
        name = re.match(r"[\w.-]+", line)[0].lower()
        if name in found or "extra ==" in line:
            continue
        try:
            found[name] = distribution(name)
        except PackageNotFoundError:
            continue  # of another system or Python
        names += found[name].requires or []
    return found.values()


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    build = f"import hatchling.build; hatchling.build.build_wheel({str(folder)!r})"
    subprocess.run([sys.executable, "-c", build], cwd=ROOT, check=True, capture_output=True)
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory):
    """Runs Python in an environment of the wheel and of what it asks for, where it can offline."""
    folder = tmp_path_factory.mktemp("environment")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "env"], check=True)
    (site,) = (folder / "env").glob("lib/python*/site-packages")
    pip = (sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-index", "--no-compile")
    subprocess.run([*pip, "--target", site, wheel], check=True)
    requires = re.findall(
        r"^Requires-Dist: (.*)$", next(site.glob("grasp*/METADATA")).read_text(), re.M
    )
    for found in asked_for(requires):
        for top in {file.parts[0] for file in found.files if file.parts[0] != ".."}:
            if not (site / top).exists():
                (site / top).symlink_to(found.locate_file(top))
    offline = ["unshare", "--map-root-user", "--net"]
    if not shutil.which("unshare") or subprocess.run([*offline, "true"]).returncode:
        offline = []
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}

    def run(*arguments, cwd, code=0):
        command = [*offline, folder / "env/bin/python", *arguments]
        done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True)
        assert done.returncode == code, done.stderr
        return done.stdout

    return run


def test_it_puts_no_general_name_into_site_packages(wheel):
    """The blocks, what a block of one's own declares its variables with, and one name besides."""
    names = {name.partition("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    assert {name for name in names if not name.endswith(".dist-info")} == {
        "block_variables", "gripper_plant", "proximity_sensor", "grasp_controller", "grasp_cosim",
    }  # fmt: skip


def test_the_modelica_package_is_where_its_page_links_to(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    page = "grasp_cosim/docs/how_to/modelica.md"
    assert {page, "grasp_cosim/docs/modelica_fmu.py", "grasp_cosim/modelica/README.md"} <= {*names}
    assert sum(name.startswith("grasp_cosim/modelica/GraspCosim/") for name in names) == 18


def test_the_page_on_a_plant_of_ones_own_runs_as_it_is_written(python, tmp_path):
    """Both of its parts, from the top, in an empty folder; the page is in the wheel as well."""

    def command(line, code=0):
        return python("-m", "grasp_cosim", *shlex.split(line)[1:], cwd=tmp_path, code=code)

    (folder,) = re.findall("Documentation: (.*)", command("grasp-cosim --help"))
    pages = [Path(folder) / f"how_to/{name}.md" for name in ("python_block", "foreign_fmu")]
    page = "".join(path.read_text("utf-8") for path in pages)
    assert "/env/lib/" in folder
    for line in INDENTED.findall(page):
        command(line)
    for kind, block in BLOCKS.findall(page):
        if kind == "console":
            for line, shown in commands_of(block):
                if line.startswith("cp "):
                    shutil.copy(*(tmp_path / name for name in line.split()[1:]))
                elif "CASE" not in line:
                    said = command(line, 1 if shown.startswith("NOT") else 0)
                    assert said.startswith(shown), line
        elif kind == "python" and block.startswith('"""'):
            (tmp_path / "vendor.py").write_text(block, "utf-8")
        elif block.startswith("[signals]"):
            (tmp_path / "bands.toml").write_text(block, "utf-8")
        elif kind == "toml":
            fill_in(tmp_path / "my_system.toml", block)
    assert (tmp_path / "vendor/report.html").is_file()


def test_the_wheel_works_in_an_empty_folder(python, tmp_path):
    def command(*arguments):
        return python("-m", "grasp_cosim", *arguments, cwd=tmp_path)

    where = python("-c", "import grasp_cosim; print(grasp_cosim.__file__)", cwd=tmp_path)
    assert "/env/lib/" in where
    run = ("run", "--stop", "0.2", "--out", "results", "--json")
    assert json.loads(command(*run))["steps"] == 2000
    command("report", "results")
    assert (tmp_path / "results/report.html").read_text("utf-8").endswith("</html>\n")
    command("init", "mine/my_system.toml")
    (tmp_path / "mine").rename(tmp_path / "moved")
    command("run", "moved/my_system.toml", "--stop", "0.2", "--out", "own", "--json")
    own, built_in = (tmp_path / folder / "signals.csv" for folder in ("own", "results"))
    assert own.read_bytes() == built_in.read_bytes()
    if shutil.which("gcc"):
        command("build", "--native", "GripperPlant", "--out", "native")
        assert (tmp_path / "native/GripperPlant.fmu").is_file()
        command("build", "--native", "--c-only", "c", "GraspController")
        assert (tmp_path / "c/arithmetic.h").is_file()
