"""Makes an FMU that Python runs: a script, the modules that it imports, pythonfmu's binaries.

The same sources give the same bytes. Why modules have a hash in their names: fmus/README.md. To be
packed, a package must be imported at the top level of a module, with `from PACKAGE import ...`:
only such an import can be given the name that the package has in the FMU.
"""

from __future__ import annotations

import ast
import io
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..base.one_piece import in_one_piece
from .shipped import block_of, entry_of, package_folder, sheet_file, sized_source

if TYPE_CHECKING:
    from .description import Description

HASH = "CONTENT_HASH"
"""Stands for the content hash until it is known."""

PACKED_AS = "fmu_export"
"""The name of this package in an FMU, which has nothing of the package that it is a part of."""

IMPORT = re.compile(r"^from (\w+)(?=[\w.]* import\b)", re.MULTILINE)
"""An import whose package is packed, unless it is of the standard library."""

BINARIES = {"so": "linux64/libpythonfmu-export.so", "dll": "win64/pythonfmu-export.dll"}
"""Those of pythonfmu by their endings, in folders that are those of an FMU."""


@dataclass(frozen=True, slots=True)
class Built:
    """An FMU in its folder, and how it is next to what was there."""

    path: Path
    status: Literal["new", "changed", "unchanged"]


@dataclass(frozen=True)
class Model:
    """What an FMU is made of, whether it will run in Python or by itself."""

    description: Description
    card: str
    """In Markdown."""
    sources: Mapping[str, bytes]
    """Its script NAME.py, and modules next to it; what they import is packed with them."""
    block: Any = None
    """The module of the block; None for a proxy."""
    file: Path | None = None
    """The source of a block that is a user's file."""
    picture: bytes | None = None
    requires: tuple[str, ...] = ()
    """Packages that must be installed where it runs."""


def shipped_model(name: str) -> Model:
    """Return the model of an FMU that comes with this package, or of a hand of another size."""
    from .contract import declared, variables
    from .description import Description
    from .page import icon

    shipped, fingers = entry_of(name)
    block = block_of(name)
    package, _, module = shipped.module.rpartition(".")
    summary = f"{shipped.summary}: {fingers} fingers" if fingers else shipped.summary
    imports = script(f"from {package} import {module} as block")
    return Model(
        Description(name, summary, variables(declared(block))),
        sheet_file(package).read_text("utf-8"),
        {f"{name}.py": imports, **sized_source(name)},
        block,
        picture=icon(name),
    )


def script(imports: str) -> bytes:
    """Return the script of an FMU, whose block is imported as `block`."""
    return f"{imports}\nfrom {PACKED_AS} import slave\n\nslave.offer(block, globals())\n".encode()


def python_members(model: Model) -> tuple[str, dict[str, bytes]]:
    """Return the content hash of the FMU that Python runs, and the files in it."""
    from .description import model_description
    from .page import PYTHON, licences, needed, page

    d = model.description
    html = page(d.name, d.summary, model.card, PYTHON, packages=needed(model.requires))
    folder = package_folder("pythonfmu") / "resources" / "binaries"
    return hashed(
        {
            "modelDescription.xml": model_description(d, HASH),
            **({"model.png": model.picture} if model.picture else {}),
            "documentation/index.html": html.encode(),
            **licences("grasp-cosim", "pythonfmu"),
            **{
                f"binaries/{Path(file).parent}/{d.name}.{kind}": (folder / file).read_bytes()
                for kind, file in BINARIES.items()
            },
            "resources/slavemodule.txt": f"{d.name}_{HASH}".encode(),
            **_renamed(with_imports(model.sources)),
        }
    )


def hashed(template: Mapping[str, bytes]) -> tuple[str, dict[str, bytes]]:
    """Return the hash of files, and the files with it in the place of HASH."""
    digest = sha256()
    for member, data in sorted(template.items()):
        digest.update(f"{member}\0{len(data)}\0".encode() + data)
    content = digest.hexdigest()[:16]
    return content, {
        name.replace(HASH, content): data.replace(HASH.encode(), content.encode())
        for name, data in template.items()
    }


def write_members(target: Path, files: Mapping[str, bytes]) -> Built:
    """Write an FMU that holds these files, unless it is there already and holds the same."""
    from ..base.zip_files import (
        write_zip,  # takes time to load, and mostly nothing is to be written
    )

    buffer = io.BytesIO()
    write_zip(buffer, dict(sorted(files.items())), deflated=True)
    return write_file(target, buffer.getvalue())


def write_file(target: Path, data: bytes) -> Built:
    """Write a file in one piece, with its folder, unless it has that content already.

    OSError names the target.
    """
    old_data = target.read_bytes() if target.is_file() else None
    if data == old_data:
        return Built(target, "unchanged")
    with in_one_piece(target) as part:
        part.write_bytes(data)
    return Built(target, "new" if old_data is None else "changed")


def _renamed(sources: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the sources as they stand in the FMU, all modules under names with HASH."""
    packages = sorted({name.partition("/")[0] for name in sources if "/" in name})
    imports = re.compile(rf"^from ({'|'.join(packages)})\b".encode(), re.MULTILINE)
    packed = {}
    for name, data in sources.items():
        package, _, module = name.partition("/")
        place = f"{package}_{HASH}/{module}" if module else f"{Path(name).stem}_{HASH}.py"
        packed[f"resources/{place}"] = imports.sub(rf"from \1_{HASH}".encode(), data)
    return packed


def with_imports(sources: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return `sources` and all modules they import, by path in the FMU without the content hash."""
    packed = dict(sources)
    paths = list(sources)
    for path in paths:  # which grow
        for module in _imported(path, packed[path]):
            for name, file in _files(module):
                if name not in packed:
                    packed[name] = file.read_bytes()
                    paths.append(name)
    return packed


@cache
def _imported(path: str, source: bytes) -> list[str]:
    """Return the modules to pack that a source imports, and names in them that may be modules."""
    modules: list[str] = []
    *package, _ = path.split("/")
    for node in ast.walk(ast.parse(source, path)):
        if not isinstance(node, ast.ImportFrom):
            continue
        above = package[: len(package) + 1 - node.level] if node.level else []
        module = ".".join([*above, *filter(None, [node.module])])
        outside = node.col_offset or module.partition(".")[0] in sys.stdlib_module_names
        if node.level or not outside:
            modules += [module, *(f"{module}.{alias.name}" for alias in node.names)]
    return modules


def _files(module: str) -> Iterator[tuple[str, Path]]:
    """Yield the files that importing a module runs, with their paths in the FMU."""
    package, *names = module.split(".")
    folder = Path(__file__).parent if package == PACKED_AS else package_folder(package)
    place = folder.joinpath(*names)
    source = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    if source.is_file():
        above = (folder.joinpath(*names[:i]) / "__init__.py" for i in range(len(names)))
        for file in (*above, source):
            yield f"{package}/{file.relative_to(folder).as_posix()}", file
