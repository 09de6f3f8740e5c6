"""Who may import what from outside; who of ours imports whom is told in pyproject.toml."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest
from grasp_cosim.fmu_export.build import SOURCES
from grasp_cosim.fmu_export.package import shipped_model, with_imports
from grasp_cosim.fmu_export.shipped import PACKAGES, SHIPPED

ROOT = Path(__file__).parent.parent
BLOCKS = {"gripper_plant", "proximity_sensor", "grasp_controller"}
STANDARD = sys.stdlib_module_names


def imported(source):
    """The packages that a source imports absolutely, wherever it does."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module.partition(".")[0]


def sources_of(package):
    """The files of a package, or of a module, of ours."""
    files = [*ROOT.glob(f"*/{package}/**/*.py"), *ROOT.glob(f"*/{package}.py")]
    assert files
    return files


def foreign(files):
    """The packages from outside the standard library that files of ours import."""
    texts = [file.read_text("utf-8") for file in files]
    return {name for text in texts for name in imported(text)} - STANDARD


def of_base(files):
    """The modules of base that files of ours import."""
    nodes = [node for file in files for node in ast.walk(ast.parse(file.read_text("utf-8")))]
    modules = [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
    return {module.split(".")[1] for module in modules if module.startswith("base.")}


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
        ("block_variables", set()),
        *(
            (f"grasp_cosim/{name}", set())
            for name in ("base/c_compilers", "base/one_piece", "base/si_units", "fmu_export/link")
        ),
    ],
)
def test_it_imports_the_standard_library_and(package, others):
    assert foreign(sources_of(package)) <= others


def test_who_makes_fmus_alone_knows_pythonfmu():
    files = sources_of("grasp_cosim")
    assert "pythonfmu" not in foreign([f for f in files if "fmu_export" not in f.parts])


def test_all_that_fmus_are_made_of_decides_whether_they_are_up_to_date():
    assert foreign(sources_of("grasp_cosim/fmu_export")) & BLOCKS == set()
    decides = {source.stem for source in SOURCES}
    writes = {"one_piece"}
    assert of_base(sources_of("grasp_cosim/fmu_export")) == decides - {"fmu_export"} | writes


def test_what_is_packed_into_fmus_imports_the_standard_library_only():
    models = [shipped_model(name) for name in SHIPPED]
    packed = with_imports({name: data for m in models for name, data in m.sources.items()})
    assert {"fmu_export/slave.py", "gripper_plant/movable.py"} < packed.keys()
    names = {name for source in packed.values() for name in imported(source)}
    assert names <= STANDARD | {*PACKAGES, "fmu_export"}


def test_few_import_by_name_what_no_contract_sees():
    """Ours: the façade, for public names and what lower packages get; the commands, of cli alone.

    Others': what an extra brings, entry points, the blocks, parts of FMPy; a metric, where a pickle
    says it is.
    """
    by_name = ("import_module", "__import__", "resolve_name", "entry_points", "run_module")
    assert {*files_with("orchestrator/grasp_cosim", *by_name)} == {
        "__init__.py", "cli/group.py", "fmi/fmpy_import.py",
        "base/checks.py", "base/registry.py", "fmu_export/shipped.py", "metrics/metric.py",
    }  # fmt: skip


def test_who_imports_by_name_below_the_facade_names_no_module_of_ours():
    ours = ("__name__", "__package__", "grasp_cosim")
    for file in ("base/checks.py", "base/registry.py", "metrics/metric.py"):
        text = (ROOT / "orchestrator/grasp_cosim" / file).read_text("utf-8")
        calls = (n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Call))
        for call in calls:
            called = getattr(call.func, "id", getattr(call.func, "attr", ""))
            if called in ("import_module", "__import__", "resolve_name", "run_module"):
                words = {getattr(n, "id", getattr(n, "value", "")) for n in ast.walk(call)}
                assert not any(own in str(word) for own in ours for word in words), file
