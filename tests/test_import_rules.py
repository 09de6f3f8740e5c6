"""Who may import what from outside; who of ours imports whom is told in pyproject.toml."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest
from grasp_fmus.build import SOURCES
from grasp_fmus.package import shipped_model, with_imports
from grasp_fmus.shipped import PACKAGES, SHIPPED

ROOT = Path(__file__).parent.parent
BLOCKS = {"gripper_plant", "proximity_sensor", "grasp_controller"}
OURS = {*BLOCKS, "block_variables", "c_compilers", "si_units", "grasp_fmus", "grasp_cosim"}
STANDARD = sys.stdlib_module_names


def imported(source):
    """The packages that a source imports absolutely, wherever it does."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module.partition(".")[0]


def foreign(package):
    """The packages from outside the standard library that one of ours imports."""
    texts = [file.read_text("utf-8") for file in ROOT.glob(f"*/{package}/**/*.py")]
    assert texts
    return {name for text in texts for name in imported(text)} - STANDARD


def files_with(root, *names):
    """The modules below a folder in which one of these names stands."""
    for file in (ROOT / root).rglob("*.py"):
        nodes = ast.walk(ast.parse(file.read_text("utf-8")))
        if any(getattr(n, "id", getattr(n, "attr", None)) in names for n in nodes):
            yield file.relative_to(ROOT / root).as_posix()


def test_the_contracts_of_imports_hold():
    done = subprocess.run(
        [sys.executable, "-c", "from importlinter.cli import lint_imports; exit(lint_imports())"],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("package", "others"),
    [
        *((name, {"block_variables"}) for name in sorted(BLOCKS)),
        *((name, set()) for name in ("block_variables", "c_compilers", "one_piece", "si_units")),
        ("grasp_fmus/link", set()),
    ],
)
def test_it_imports_the_standard_library_and(package, others):
    assert foreign(package) <= others


def test_the_orchestrator_imports_no_pythonfmu():
    assert "pythonfmu" not in foreign("grasp_cosim")


def test_all_that_fmus_are_made_of_decides_whether_they_are_up_to_date():
    assert foreign("grasp_fmus") & OURS <= {*SOURCES}


def test_what_is_packed_into_fmus_imports_the_standard_library_only():
    models = [shipped_model(name) for name in SHIPPED]
    packed = with_imports({name: data for m in models for name, data in m.sources.items()})
    assert {"grasp_fmus/slave.py", "gripper_plant/movable.py"} < packed.keys()
    names = {name for source in packed.values() for name in imported(source)}
    assert names <= STANDARD | {*PACKAGES, "grasp_fmus"}


def test_few_import_by_name_what_no_contract_sees():
    """The table of blocks; the public names, the commands, and what an extra brings."""
    by_name = ("import_module", "__import__")
    assert {*files_with("fmus/grasp_fmus", *by_name)} == {"shipped.py"}
    rooms = {file.partition("/")[0] for file in files_with("orchestrator/grasp_cosim", *by_name)}
    assert rooms == {"__init__.py", "cli", "base"}
    higher = {f.partition("/")[0] for f in files_with("orchestrator/grasp_cosim", "higher")}
    assert higher == {"system", "metrics", "recording"}
