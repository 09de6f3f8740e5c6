"""What an FMU brings along follows from its script's imports: nothing missing, nothing else."""

import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest
from grasp_fmus.build import build_block
from grasp_fmus.package import IMPORT, with_imports
from grasp_fmus.shipped import SHIPPED

SPRING = Path(__file__).parents[2] / "docs" / "spring_plant.py"

LOAD = """
import sys, importlib
sys.path.insert(0, sys.argv[1])
importlib.import_module(open(sys.argv[1] + "/slavemodule.txt").read())
for module in list(sys.modules.values()):
    if (getattr(module, "__file__", None) or "").startswith(sys.argv[1]):
        print(module.__file__)
"""


def check_packed(fmu, folder):
    """A bare Python that imports the script imports every module in the FMU, and finds them all."""
    with ZipFile(fmu) as archive:
        archive.extractall(folder)
    resources = folder / "resources"
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", LOAD, str(resources)],
        capture_output=True, check=True, text=True,
    )  # fmt: skip
    assert sorted(done.stdout.split("\n")[:-1]) == sorted(map(str, resources.rglob("*.py")))


@pytest.mark.parametrize("name", SHIPPED)
def test_the_modules_of_an_fmu_are_those_that_its_script_imports(fmus, tmp_path, name):
    """Each under a name that ends in the hash of the content, which is the GUID."""
    check_packed(fmus / f"{name}.fmu", tmp_path)
    content = (tmp_path / "resources/slavemodule.txt").read_text().removeprefix(f"{name}_")
    assert f'guid="{content}"' in (tmp_path / "modelDescription.xml").read_text()
    packed = [file.name.partition(".")[0] for file in (tmp_path / "resources").glob("[!_]*")]
    assert {module.rpartition("_")[2] for module in packed} == {content, "slavemodule"}


def test_the_modules_of_a_block_of_ones_own_are_those_that_it_imports(tmp_path):
    check_packed(build_block(SPRING, tmp_path).path, tmp_path / "unpacked")


FILES = {
    "__init__.py": "",
    "a.py": "import math\nfrom . import b, NAME\nfrom .inner import deep\nfrom typing import Any",
    "b.py": "def f():\n    from .late import x\n    import numpy\n    from scipy import linalg\n",
    "late.py": "",
    "unused.py": "",
    "inner/__init__.py": "from .. import up",
    "inner/deep.py": "from second_package_of_the_test.leaf import f\n",
    "inner/unused.py": "",
    "up.py": '"""Of text,\nfrom unused, too."""\n',
    "data.txt": "",
}


def test_imports_are_followed_in_whatever_form_they_come(tmp_path, monkeypatch):
    second = {"__init__.py": "", "leaf.py": "", "unused.py": ""}
    for package, files in (("package", FILES), ("second_package", second)):
        for name, text in files.items():
            file = tmp_path / f"{package}_of_the_test" / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    packed = with_imports({"Script.py": b"from package_of_the_test import a\n"})
    unused = {"unused.py", "inner/unused.py", "data.txt"}
    assert packed.keys() == {
        "Script.py",
        *(f"package_of_the_test/{name}" for name in FILES.keys() - unused),
        "second_package_of_the_test/__init__.py",
        "second_package_of_the_test/leaf.py",
    }
    assert packed["package_of_the_test/b.py"] == FILES["b.py"].encode()


def test_a_package_that_is_not_installed_is_no_surprise_of_the_host(tmp_path):
    with pytest.raises(ImportError, match="no_such_package: no such package; must be installed"):
        with_imports({"Script.py": b"from no_such_package import block\n"})


def test_an_import_is_none_in_the_middle_of_a_text():
    text = 'from a import b\nfrom c.d import (\n  e\n)\n"""\nfrom the start, import is\n"""\n'
    assert IMPORT.findall(text) == ["a", "c"]
