"""Who may import whom: blocks only the standard library, the orchestrator no physics."""

import ast
import sys
from functools import cache
from pathlib import Path

import pytest
from grasp_fmus.build import SOURCES
from grasp_fmus.package import shipped_model, with_imports
from grasp_fmus.shipped import PACKAGES, SHIPPED
from support.imports import (
    Import,
    calls,
    circles,
    graph,
    parsed,
    read_imports,
    read_modules,
    room,
    upward,
)  # fmt: skip

ROOT = Path(__file__).parent.parent
BLOCKS = {
    "plant": "gripper_plant",
    "sensor": "proximity_sensor",
    "controller": "grasp_controller",
}
OURS = {*BLOCKS.values(), "block_variables", "c_compilers", "si_units", "grasp_fmus", "grasp_cosim"}


LINK = "grasp_fmus.link"


def imports(folder):
    """File and top-level package of every absolute import below a folder."""
    for file, module in modules(folder):
        yield file, module.partition(".")[0]


@cache
def modules(folder):
    """File and module of every absolute import below a folder."""
    files = sorted(folder.rglob("*.py"))
    assert files, folder
    return [
        (file.name, name)
        for file in files
        for node in parsed(file.read_text("utf-8"))[0]
        for name in imported(node)
    ]


def imported(node):
    """The modules that a statement imports absolutely."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
        return [node.module]
    return []


@pytest.mark.parametrize(("folder", "package"), BLOCKS.items())
def test_a_block_imports_the_standard_library_and_its_declarations_only(folder, package):
    foreign = {
        (file, name)
        for file, name in imports(ROOT / folder / package)
        if name not in {*sys.stdlib_module_names, "block_variables"}
    }
    assert not foreign


def test_the_orchestrator_imports_no_physics_and_no_pythonfmu():
    forbidden = {*BLOCKS.values(), "pythonfmu"}
    found = {(f, n) for f, n in imports(ROOT / "orchestrator/grasp_cosim") if n in forbidden}
    assert not found


def test_fmpy_is_imported_in_one_room_which_keeps_it_from_printing():
    room = {f for f, module in modules(ROOT / "orchestrator/grasp_cosim/fmi") if is_fmpy(module)}
    users = {f for f, module in modules(ROOT / "orchestrator/grasp_cosim") if is_fmpy(module)}
    assert users == room > {"__init__.py"}


def is_fmpy(module):
    return module.partition(".")[0] == "fmpy"


def test_the_orchestrator_builds_fmus_at_few_places_only():
    builders = {
        f
        for f, module in modules(ROOT / "orchestrator/grasp_cosim")
        if module.startswith("grasp_fmus") and not module.startswith(LINK)
    }
    builds = {"build.py", "controllers.py", "native.py", "proxy.py", "system.py"}
    assert builders == builds


def test_the_protocol_of_the_link_is_known_to_both_its_ends_alone_and_knows_nobody():
    users = {f for f, m in modules(ROOT / "orchestrator/grasp_cosim") if m.startswith(LINK)}
    assert users == {"driven.py", "protocol.py", "served.py", "server.py"}
    foreign = {n for _, n in imports(ROOT / "fmus/grasp_fmus/link")} - sys.stdlib_module_names
    assert not foreign


def test_the_fmu_adapter_knows_no_physics_but_for_a_table_of_names():
    found = {n for _, n in imports(ROOT / "fmus/grasp_fmus") if n in {*BLOCKS.values()}}
    assert not found
    naming = {f.name for f in (ROOT / "fmus/grasp_fmus").rglob("*.py") if BY_NAME & called(f)}
    assert naming == {"shipped.py"}
    assert {s.module.partition(".")[0] for s in SHIPPED.values()} == {*BLOCKS.values()}


def called(file):
    """The names in a file."""
    return {n.id for n in ast.walk(ast.parse(file.read_text("utf-8"))) if isinstance(n, ast.Name)}


def test_all_that_fmus_are_made_of_decides_whether_they_are_up_to_date():
    assert {n for _, n in imports(ROOT / "fmus/grasp_fmus")} & OURS <= {*SOURCES}


def test_what_is_packed_into_fmus_imports_the_standard_library_only():
    models = [shipped_model(name) for name in SHIPPED]
    packed = with_imports({name: data for m in models for name, data in m.sources.items()})
    assert {"grasp_fmus/slave.py", "gripper_plant/movable.py"} < packed.keys()
    ours = {*PACKAGES, "grasp_fmus"}
    foreign = {
        (file, name)
        for file, source in packed.items()
        for node in parsed(source.decode())[0]
        for name in imported(node)
        if name.partition(".")[0] not in sys.stdlib_module_names | ours
    }
    assert not foreign


@pytest.mark.parametrize("package", ["block_variables", "c_compilers", "one_piece", "si_units"])
def test_what_fmus_and_orchestrator_share_imports_the_standard_library_only(package):
    found = {name for _, name in imports(ROOT / "fmus" / package)}
    assert found
    assert found <= sys.stdlib_module_names


# ------------------------------------------------------------------ rooms of the orchestrator

FLOORS = (
    ("base",),
    ("interface",),
    ("system",),
    ("fmi", "realtime", "metrics", "exchange"),
    ("recording", "ssp", "inspection"),
    ("master", "report"),
    ("sweeps", "comparison", "hil"),
    ("grasp",),
    ("hand",),
    ("cli", "__init__"),
    ("__main__",),
)
"""From the ground up: a room imports from its own floor and from those below."""

BY_NAME = frozenset({"import_module", "__import__"})
"""Functions that import what no test sees."""


@pytest.fixture(scope="module")
def sources():
    return read_modules(ROOT / "orchestrator/grasp_cosim")


def test_a_room_imports_from_rooms_below_it_and_nothing_goes_in_a_circle(sources):
    imports = read_imports(sources)
    found = [
        *upward(imports, FLOORS),
        *(f"rooms in a circle: {circle}" for circle in circles(graph(imports, of_rooms=True))),
        *(f"files in a circle: {circle}" for circle in circles(graph(imports))),
    ]
    assert not found, "\n".join(["", *found])


def test_only_three_rooms_import_by_name(sources):
    """The top its public names, the command line its commands, base what an extra brings."""
    assert {room(module) for module in calls(sources, BY_NAME)} == {"__init__", "cli", "base"}


def test_four_rooms_take_by_name_what_is_higher(sources):
    """A system the reader of its file, metrics their groups, a result its pictures, and a run that
    has proxies their figures.
    """
    found = {room(module) for module in calls(sources, frozenset({"higher"}))}
    assert found == {"system", "metrics", "recording", "master"}


def test_all_files_are_read(sources):
    assert {"grasp_cosim", "grasp_cosim.base.errors", "grasp_cosim.master.loop"} <= sources.keys()
    imports = read_imports(sources)
    assert len({i.source for i in imports}) > 100
    assert {room(i.source) for i in imports} | {room(i.target) for i in imports} >= {
        name for floor in FLOORS for name in floor
    }


HOUSE = {"house": "", "house.attic": "", "house.attic.a": "", "house.cellar": "", "house.pipe": ""}
"""A package with the folders attic and cellar, the module pipe, and a in the attic."""

STOREYS = (("pipe",), ("cellar",), ("attic",), ("__init__",))


@pytest.mark.parametrize("root", ["fmus", *BLOCKS])
def test_no_files_of_fmus_or_of_a_block_go_in_a_circle(root):
    packages = [file.parent for file in (ROOT / root).glob("*/__init__.py")]
    sources = {name: text for p in packages for name, text in read_modules(p).items()}
    found = circles(graph(read_imports(sources)))
    assert len(sources) > 1
    assert found == []


@pytest.mark.parametrize(
    "line",
    [
        "from ..attic.a import name",
        "from ..attic import a",
        "from .. import pipe, attic",
        "from house.attic.a import name as other",
        "import house.attic.a",
        "import os, house.attic.a as b",
        "def f():\n    from ..attic.a import name",
        "if TYPE_CHECKING:\n    from ..attic.a import name",
        "class A:\n    def f(self):\n        if True:\n            import house.attic.a",
        "try:\n    pass\nfinally:\n    from ..attic.a import *",
    ],
)
def test_an_import_upward_is_found_wherever_it_stands(line):
    made = {**HOUSE, "house.cellar.b": f"import os\n{line}\n"}
    (found,) = upward(read_imports(made), STOREYS)
    assert found.startswith(f"house.cellar.b:{line.count(chr(10)) + 2} imports house.attic")
    assert found.endswith(": attic is above cellar")


@pytest.mark.parametrize(
    ("name", "line", "target"),
    [
        ("house.attic.a", "from . import b", "house.attic.b"),
        ("house.attic.a", "from .b import name", "house.attic.b"),
        ("house.attic", "from .b import name", "house.attic.b"),
        ("house.attic", "from ..pipe import name", "house.pipe"),
        ("house.attic.a", "from .. import pipe", "house.pipe"),
        ("house.attic.a", "from .. import name", "house"),
        ("house", "from .pipe import name", "house.pipe"),
        ("house.pipe", "from . import attic", "house.attic"),
        ("house.pipe", "import house", "house"),
    ],
)
def test_an_import_means_the_module(name, line, target):
    made = {**HOUSE, "house.attic.b": "", name: line}
    assert read_imports(made) == [Import(name, 1, target)]


def test_others_and_those_downward_are_fine():
    made = {**HOUSE, "house.attic.a": "import os.path\nfrom ..cellar import x\nfrom .. import pipe"}
    imports = read_imports(made)
    assert [i.target for i in imports] == ["house.cellar", "house.pipe"]
    assert upward(imports, STOREYS) == []
    assert circles(graph(imports)) == circles(graph(imports, of_rooms=True)) == []


def test_a_room_that_is_on_no_floor_is_found():
    imports = read_imports({**HOUSE, "house.shed": "from . import pipe"})
    assert upward(imports, STOREYS) == ["shed: a room on no floor"]


def test_a_circle_of_files_in_a_room_is_found():
    made = {
        **HOUSE,
        "house.attic.a": "from .b import name",
        "house.attic.b": "def f():\n    from .c import name",
        "house.attic.c": "if TYPE_CHECKING:\n    from . import a",
        "house.attic.d": "from . import a",
    }
    imports = read_imports(made)
    assert upward(imports, STOREYS) == []
    assert circles(graph(imports, of_rooms=True)) == []
    assert circles(graph(imports)) == [
        "house.attic.a -> house.attic.b -> house.attic.c -> house.attic.a"
    ]


def test_a_circle_of_rooms_without_one_of_files_is_found():
    made = {
        **HOUSE,
        "house.attic.a": "from .. import cellar",
        "house.cellar.b": "import house.attic",
    }
    imports = read_imports(made)
    assert circles(graph(imports)) == []
    assert circles(graph(imports, of_rooms=True)) == ["attic -> cellar -> attic"]


def test_every_circle_is_found_once():
    graph = {"a": ["b", "c"], "b": ["a"], "c": ["d"], "d": ["c"], "e": ["a"]}
    assert circles(graph) == ["a -> b -> a", "c -> d -> c"]


def test_an_import_by_name_is_found():
    made = {"a": "import_module('b')", "b": "importlib.import_module(x)", "c": "__import__('d')"}
    assert calls({**made, "d": "import a"}, BY_NAME) == {"a", "b", "c"}
