"""The imports of the script of a Python FMU, found without running it."""

import ast
import warnings
from collections.abc import Iterator
from importlib.machinery import all_suffixes
from pathlib import Path


def imports(resources: Path, script: str) -> tuple[set[str], list[str]]:
    """Imports of a script at once from outside of the FMU, and files in it that do not parse.

    An import that is allowed to fail, under try or if or in a function, does not count.
    """
    outside: set[str] = set()
    errors, names, seen = [], [script], {""}
    while names:
        name = names.pop()
        if name in seen:
            continue
        seen.add(name)
        top, parent = name.partition(".")[0], name.rpartition(".")[0]
        base = resources.joinpath(*name.split("."))
        files = [p for p in (base / "__init__.py", base.parent / f"{base.name}.py") if p.is_file()]
        if not any((resources / f"{top}{suffix}").exists() for suffix in ("", *all_suffixes())):
            outside.add(top)
        if not files:
            continue
        try:
            with warnings.catch_warnings(action="ignore"):
                tree = ast.parse(files[0].read_bytes(), files[0].relative_to(resources))
        except (SyntaxError, ValueError) as error:
            errors.append(str(error))
        else:
            names += [parent, *_imported(tree, name if files[0].stem == "__init__" else parent)]
    return outside, errors


def _imported(tree: ast.Module | ast.ClassDef, package: str) -> Iterator[str]:
    """Imports without a condition, including names that may be modules of a package."""
    for node in tree.body:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")
            base = above[: len(above) + 1 - node.level] if node.level else []
            module = ".".join([*base, *filter(None, [node.module])])
            yield from (module, *(f"{module}.{alias.name}" for alias in node.names))
        elif isinstance(node, ast.ClassDef):
            yield from _imported(node, package)
