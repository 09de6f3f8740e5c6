"""Finds what an FMU must bring along: the modules that its script imports, and those they import.

Packages are packed that a module imports at its top level with `from PACKAGE import ...`: only such
an import can be given the name that the package has in the FMU.
"""

import ast
import re
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path

IMPORT = re.compile(r"^from (\w+)(?=[\w.]* import\b)", re.MULTILINE)
"""An import whose package is packed, unless it is of the standard library."""


def with_imports(sources: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return `sources` and all modules they import, by path in the FMU without the content hash."""
    found = dict(sources)
    waiting = list(sources)
    while waiting:
        path = waiting.pop()
        for module in _imported(path, found[path]):
            for name, file in _files(module):
                if name not in found:
                    found[name] = file.read_bytes()
                    waiting.append(name)
    return found


def packages(*roots: str) -> dict[str, Path]:
    """Return the folders of these packages, and of those to pack that their modules import."""
    found: dict[str, Path] = {}
    waiting = [*roots]
    while waiting:
        package = waiting.pop()
        found[package] = package_folder(package)
        for file in found[package].rglob("*.py"):
            imported = {*IMPORT.findall(file.read_text("utf-8"))} - sys.stdlib_module_names
            waiting += imported - {*found, *waiting}
    return dict(sorted(found.items()))


def package_folder(package: str) -> Path:
    """Return the folder of a package, which is not imported for that; ImportError without one."""
    spec = find_spec(package)
    if spec is None or spec.origin is None:
        raise ImportError(f"{package}: no such package; must be installed")
    return Path(spec.origin).parent


def card_file(package: str) -> Path:
    """Return the equation card of a package: in it once it is installed, in the sources beside."""
    inside = package_folder(package) / "README.md"
    return inside if inside.exists() else inside.parents[1] / "README.md"


@cache
def _imported(path: str, source: bytes) -> list[str]:
    """Return the modules to pack that a source imports, and names in them that may be modules."""
    found: list[str] = []
    *package, _ = path.split("/")
    for node in _run(ast.parse(source, path)):
        if not isinstance(node, ast.ImportFrom):
            continue
        above = package[: len(package) + 1 - node.level] if node.level else []
        module = ".".join([*above, *filter(None, [node.module])])
        if node.level or not (
            node.col_offset or module.partition(".")[0] in sys.stdlib_module_names
        ):
            found += [module, *(f"{module}.{alias.name}" for alias in node.names)]
    return found


def _run(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield all statements and what holds some, but those that only a type checker looks at."""
    for node in ast.iter_child_nodes(tree):
        checked = isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        if not (checked or isinstance(node, ast.expr)):
            yield node
            yield from _run(node)


def _files(module: str) -> Iterator[tuple[str, Path]]:
    """Yield the files that importing a module runs, with their paths in the FMU."""
    package, *rest = module.split(".")
    folder = package_folder(package)
    place = folder.joinpath(*rest)
    own = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    if own.is_file():
        above = (folder.joinpath(*rest[:i]) / "__init__.py" for i in range(len(rest)))
        for file in (*above, own):
            yield f"{package}/{file.relative_to(folder).as_posix()}", file
