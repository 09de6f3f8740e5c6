"""Which module of a package imports which, wherever the import stands, and what is wrong in that.

A room is what lies directly in the package: a folder or a module. Floors are listed from the ground
up; a room may import from its own floor and from those below, as far as nothing goes in a circle.
"""

import ast
from collections.abc import Mapping, Sequence
from functools import cache
from typing import NamedTuple

Graph = Mapping[str, Sequence[str]]
"""By name, the names that it imports."""


class Import(NamedTuple):
    """An import of `target` by `source`, both modules by their full name, in a line."""

    source: str
    line: int
    target: str


def read_modules(package):
    """The source text of every module of a package, by full name."""
    found = {}
    for file in sorted(package.rglob("*.py")):
        parts = file.relative_to(package.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file.read_text("utf-8")
    return found


def packages(names):
    """Those of the modules that have others in them."""
    return {name for name in names if any(other.startswith(f"{name}.") for other in names)}


@cache
def parsed(text):
    """The imports of a source, and the names by which it calls functions."""
    nodes = [*ast.walk(ast.parse(text))]
    called = (node.func for node in nodes if isinstance(node, ast.Call))
    names = {str(getattr(f, "attr", None) or getattr(f, "id", None)) for f in called}
    return [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)], names


def read_imports(sources):
    """Every import among these modules: in functions and under TYPE_CHECKING, too."""
    folders = packages(list(sources))
    found = {
        Import(name, line, target)
        for name, text in sources.items()
        for line, target in _imports(name, text, name in folders, sources)
        if target != name
    }
    return sorted(found)


def _imports(name, text, folder, known):
    for node in parsed(text)[0]:
        if isinstance(node, ast.Import):
            wanted = [alias.name for alias in node.names]
        else:
            parts = name.split(".")
            above = parts[: len(parts) - node.level + (1 if folder else 0)] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            wanted = [f"{base}.{alias.name}" for alias in node.names]
        for module in wanted:
            while module and module not in known:  # a name in a module: the module
                module = module.rpartition(".")[0]
            if module:
                yield node.lineno, module


def calls(sources, names):
    """The modules that call a function by one of these names."""
    return {module for module, text in sources.items() if parsed(text)[1] & names}


def room(module):
    """The room of a module; that of the package itself is "__init__"."""
    return [*module.split("."), "__init__"][1]


def upward(imports, floors):
    """A line for each import from a higher floor, and for each room that is on none."""
    floor = {name: i for i, names in enumerate(floors) for name in names}
    rooms = {room(module) for i in imports for module in (i.source, i.target)}
    lost = [f"{name}: a room on no floor" for name in sorted(rooms - floor.keys())]
    return lost + [
        f"{i.source}:{i.line} imports {i.target}: {room(i.target)} is above {room(i.source)}"
        for i in imports
        if floor.get(room(i.target), -1) > floor.get(room(i.source), len(floors))
    ]


def graph(imports, of_rooms=False):
    """Who imports whom; among rooms without what a room imports from itself."""
    found = {}
    for i in imports:
        source, target = (room(i.source), room(i.target)) if of_rooms else (i.source, i.target)
        found.setdefault(source, set())
        if source != target:
            found[source].add(target)
    return {name: sorted(targets) for name, targets in found.items()}


def circles(imports):
    """The shortest circle through each name that is in one, each once, like "a -> b -> a"."""
    found = set()
    for name in imports:
        if way := _way_back(name, imports):
            first = way.index(min(way))
            turned = way[first:] + way[:first]
            found.add(" -> ".join([*turned, turned[0]]))
    return sorted(found)


def _way_back(name, imports):
    """The names on the shortest way from a name to itself; none where there is no way."""
    before = {}
    edge = [name]
    while edge:
        following = []
        for here in edge:
            for there in imports.get(here, ()):
                if there == name:
                    way = [here]
                    while way[-1] != name:
                        way.append(before[way[-1]])
                    return way[::-1]
                if there not in before:
                    before[there] = here
                    following.append(there)
        edge = following
    return []
