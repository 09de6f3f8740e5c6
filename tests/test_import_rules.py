"""Who may import whom: blocks only the standard library, the orchestrator no physics."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from grasp_fmus.packing import packages, with_imports
from grasp_fmus.shipped import SCRIPTS

ROOT = Path(__file__).parent.parent
BLOCKS = {
    "plant": "gripper_plant",
    "sensor": "proximity_sensor",
    "controller": "grasp_controller",
}
OURS = {*BLOCKS.values(), "grasp_fmus", "grasp_cosim"}


LINK = "grasp_fmus.link"


def imports(folder: Path) -> Iterator[tuple[str, str]]:
    """File and top-level package of every absolute import below a folder."""
    for file, module in modules(folder):
        yield file, module.partition(".")[0]


def modules(folder: Path) -> Iterator[tuple[str, str]]:
    """File and module of every absolute import below a folder."""
    files = sorted(folder.rglob("*.py"))
    assert files, folder
    for file in files:
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            for name in imported(node):
                yield file.name, name


def imported(node: ast.AST) -> list[str]:
    """The modules that a statement imports absolutely."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
        return [node.module]
    return []


def imported_at_once(source: str) -> set[str]:
    """The top-level packages that a module imports while it is itself imported."""
    at_once: list[ast.AST] = [ast.parse(source)]
    found = set()
    while at_once:
        node = at_once.pop()
        found |= {name.partition(".")[0] for name in imported(node)}
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            at_once += ast.iter_child_nodes(node)
    return found


@pytest.mark.parametrize(("folder", "package"), BLOCKS.items())
def test_a_block_imports_the_standard_library_only(folder: str, package: str) -> None:
    foreign = {
        (file, name)
        for file, name in imports(ROOT / folder / package)
        if name not in sys.stdlib_module_names
    }
    assert foreign == ({("mujoco_box.py", "mujoco")} if package == "gripper_plant" else set())


def test_mujoco_is_imported_where_it_is_used_and_not_before() -> None:
    source = (ROOT / "plant/gripper_plant/mujoco_box.py").read_text("utf-8")
    assert "math" in imported_at_once(source)
    assert "mujoco" not in imported_at_once(source)


@pytest.mark.parametrize(
    "line",
    [
        "import mujoco",
        "import mujoco.viewer as seen",
        "from mujoco import MjModel",
        "from mujoco.viewer import launch",
        "if True:\n    from mujoco import MjModel",
    ],
)
def test_an_import_at_once_is_seen_whatever_its_form(line: str) -> None:
    assert imported_at_once(f"import math\n{line}\n") == {"math", "mujoco"}
    later = "".join(f"    {part}\n" for part in line.splitlines())
    assert imported_at_once(f"import math\ndef step():\n{later}") == {"math"}


def test_the_orchestrator_imports_no_physics_and_no_pythonfmu() -> None:
    forbidden = {*BLOCKS.values(), "pythonfmu"}
    found = {(f, n) for f, n in imports(ROOT / "orchestrator/grasp_cosim") if n in forbidden}
    assert not found


def test_the_orchestrator_builds_fmus_at_three_places_only() -> None:
    builders = {
        f
        for f, module in modules(ROOT / "orchestrator/grasp_cosim")
        if module.startswith("grasp_fmus") and not module.startswith(LINK)
    }
    assert builders == {"fmus.py", "system.py", "proxy.py"}


def test_the_connection_protocol_is_known_to_the_bench_alone_and_knows_nobody() -> None:
    users = {f for f, m in modules(ROOT / "orchestrator/grasp_cosim") if m.startswith(LINK)}
    assert users == {"bench.py", "model.py", "server.py", "protocol.py"}
    foreign = {n for _, n in imports(ROOT / "fmus/grasp_fmus/link")} - sys.stdlib_module_names
    assert not foreign


def test_the_fmu_adapter_knows_no_physics_but_for_the_scripts() -> None:
    found = {(f, n) for f, n in imports(ROOT / "fmus/grasp_fmus") if n in OURS - {"grasp_fmus"}}
    assert found == {
        ("GripperPlant.py", "gripper_plant"),
        ("GripperPlantCompliant.py", "gripper_plant"),
        ("GripperPlantMovable.py", "gripper_plant"),
        ("GripperPlantMuJoCo.py", "gripper_plant"),
        ("ProximitySensor.py", "proximity_sensor"),
        ("GraspController.py", "grasp_controller"),
    }


def test_what_is_packed_into_fmus_imports_the_standard_library_only() -> None:
    scripts = {script.name: script.read_bytes() for script in SCRIPTS.glob("*.py")}
    packed = with_imports({**scripts, "Proxy.py": b"from grasp_fmus import proxy\n"})
    assert {"grasp_fmus/slave.py", "grasp_fmus/link/client.py"} < packed.keys()
    ours = packages("grasp_fmus").keys()
    foreign = {
        (file, name)
        for file, source in packed.items()
        for node in ast.walk(ast.parse(source))
        for name in imported(node)
        if name.partition(".")[0] not in sys.stdlib_module_names | ours
    }
    assert foreign == {("gripper_plant/mujoco_box.py", "mujoco")}
