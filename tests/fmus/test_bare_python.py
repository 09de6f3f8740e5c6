"""The FMUs need a Python and nothing else: no package of ours, none of anybody, any version."""

import json
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
from support import fmi2, fmi3
from support.marks import slow

VERSIONS = ["3.11", "3.12", "3.13", "3.14", "3.15"]

_ASK = "import sys; print('{}.{}'.format(*sys.version_info))"


@cache
def python(version):
    """The program of a Python of that version; skips the test without."""
    programs = [
        sys.executable,
        shutil.which(f"python{version}"),
        *sorted((Path.home() / ".pyenv/versions").glob(f"{version}.*/bin/python")),
    ]
    for program in map(str, filter(None, programs)):  # a shim of pyenv may be of no Python at all
        done = subprocess.run([program, "-c", _ASK], capture_output=True, text=True)
        if (done.returncode, done.stdout.strip()) == (0, version):
            return program
    pytest.skip(f"PYTHON {version} IS NOT ON THIS MACHINE: the FMUs go untested with it")


STEPS, H = 50, 1e-3

HOST = f"""
import sys
FIRST = set(sys.modules)  # what Python itself has imported, with a distribution's sitecustomize
sys.path.insert(0, ".")
from support.fmi2 import Fmu, Instance
import json, sysconfig
from pathlib import Path
path, folder, values = sys.argv[1:]
fmu = Fmu(Path(path), Path(folder).resolve())
outputs = {{name: [] for name in fmu.names("output")}}
with Instance(fmu).initialise(**json.loads(values)) as instance:
    for k in range({STEPS}):
        assert instance.step(k * {H}, {H}) == 0
        for name, seen in outputs.items():
            get = instance.get_boolean if name in fmu.booleans else instance.get_real
            seen.append(float(get([fmu.references[name]])[1][0]).hex())
    assert [instance.step(0.0, -1.0) for _ in range(9)] == [instance.fmu.refused] * 9
    assert "step size = -1.0 s" in instance.log[8].text
imported = [sys.modules[name] for name in sys.modules.keys() - FIRST]
files = filter(None, (getattr(module, "__file__", None) for module in imported))
print(json.dumps([outputs, sysconfig.get_path("stdlib"), [str(Path(f).resolve()) for f in files]]))
"""


FORCE = {"force[1]": -60.0, "force[2]": 45.0}
NEAR = {
    "position[1]": 0.09, "position[2]": -0.1, "velocity[1]": -0.1, "velocity[2]": 0.2,
    "intensity[1]": 0.05, "intensity[2]": 0.04,
}  # fmt: skip
CASES = {
    "GripperPlant": FORCE,  # both fingers hit the object
    "GripperPlantCompliant": FORCE,
    "GripperPlantDelicate": FORCE,
    "GripperPlantMovable": FORCE,
    "ProximitySensor": {"gap": 0.0123},
    "GraspController": NEAR,
    "GraspControllerAdaptive": NEAR,
}
"""Inputs that make something happen within the steps."""


def hosted(program, fmu, folder):
    """The outputs, the folder of the standard library, and the files of what was imported."""
    done = subprocess.run(
        [program, "-I", "-c", HOST, fmu, folder / fmu.stem, json.dumps(CASES[fmu.stem])],
        cwd=folder, env={"PATH": "/usr/bin:/bin"}, capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, ""), fmu
    return json.loads(done.stdout)


@pytest.mark.slow
@pytest.mark.parametrize("version", [VERSIONS[0], *map(slow, VERSIONS[1:])])
def test_runs_where_nothing_is_installed(fmus, tmp_path, version):
    """In every version the same, bit for bit."""
    venv = tmp_path / "venv"
    create = [python(version), "-m", "venv", "--without-pip", str(venv)]
    subprocess.run(create, check=True, cwd=tmp_path, env={"PATH": "/usr/bin:/bin"})
    (tmp_path / "support").mkdir()
    for module in (fmi2, fmi3):
        shutil.copy(str(module.__file__), tmp_path / "support")
    for name in CASES:
        fmu = fmus / f"{name}.fmu"
        outputs, standard, modules = hosted(venv / "bin/python", fmu, tmp_path)
        assert outputs == hosted(sys.executable, fmu, tmp_path)[0]
        if name.startswith("GripperPlant"):
            assert all(outputs[f"contact[{j}]"][-1] == (1.0).hex() for j in (1, 2))
        assert any(Path(module).is_relative_to(tmp_path / name) for module in modules)
        ours = [m for m in modules if Path(m).is_relative_to(tmp_path)]
        theirs = [m for m in modules if Path(m).is_relative_to(Path(standard).resolve())]
        assert {*modules} == {*ours, *theirs}
        assert not [module for module in theirs if "site-packages" in module]
