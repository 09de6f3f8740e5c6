"""Makes an FMU: a script and what it imports, pythonfmu's binaries, description, documentation.

The same sources give the same bytes. Why modules have a hash in their names: fmus/README.md.
"""

import hashlib
import io
import re
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from .binary import answers, bound, mended, preamble
from .changes import changes, read_members
from .contract import declared, variables
from .documentation import BLOCK, Making, icon, licences, page
from .folder import Built, write_file
from .model_description import Description, model_description, version
from .packing import card_file, package_folder, with_imports
from .shipped import slave_class

BINARIES = package_folder("pythonfmu") / "resources" / "binaries"
HASH = "CONTENT_HASH"
"""Stands for the content hash until it is known."""


@dataclass(frozen=True)
class Model:
    """What an FMU is made of, whether it will run in Python or by itself."""

    description: Description
    card: str
    """In Markdown."""
    sources: Mapping[str, bytes]
    """Its script NAME.py, and modules beside it; what they import is packed with them."""
    block: Any = None
    """The module of the block; None for a proxy."""
    file: Path | None = None
    """The source of a block that is a file of one's own."""
    picture: bytes | None = None
    making: Making = BLOCK
    requires: Sequence[str] = ()
    """Packages that must be installed where it runs."""


def build_fmu(script: Path, out: Path, bind_python: str | None = None) -> Built:
    """Build the FMU of one script into the folder `out`; the script's name is that of the FMU.

    `bind_python` is as in build(). An FMU that is there with the same content is left alone.
    """
    return write_fmu(out / f"{script.stem}.fmu", shipped_model(script), bind_python)


def shipped_model(script: Path) -> Model:
    """Return the model of a script."""
    slave = slave_class(script)
    name = script.stem
    return Model(
        Description(name, (slave.__doc__ or "").rstrip("."), variables(declared(slave.block))),
        card_file(slave.block.__package__).read_text("utf-8"),
        {script.name: script.read_bytes()},
        slave.block,
        picture=icon(name),
        requires=slave.requires,
    )


def write_fmu(target: Path, model: Model, bind_python: str | None) -> Built:
    """Write the FMU that runs in Python, unless it is there already with the same content."""
    return write_members(target, python_members(model, bind_python)[1])


def python_members(model: Model, bind_python: str | None = None) -> tuple[str, dict[str, bytes]]:
    """Return the content hash of the FMU that runs in Python, and the files in it."""
    name = model.description.name
    packed = with_imports(model.sources)
    library = None
    if bind_python:
        packed[f"{name}.py"] = preamble(bind_python).encode() + packed[f"{name}.py"]
        library = answers(bind_python).library
    html = page(
        name, model.description.summary, model.card, version(), library, model.making,
        model.requires,
    )  # fmt: skip
    template = {
        "modelDescription.xml": model_description(model.description, HASH),
        **({"model.png": model.picture} if model.picture else {}),
        "documentation/index.html": html.encode(),
        **{f"documentation/licenses/{file}": text for file, text in licences().items()},
        f"binaries/linux64/{name}.so": _linux_binary(bind_python),
        f"binaries/win64/{name}.dll": (BINARIES / "win64/pythonfmu-export.dll").read_bytes(),
        "resources/slavemodule.txt": f"{name}_{HASH}".encode(),
        **_renamed(packed),
    }
    return hashed(template)


def hashed(template: Mapping[str, bytes]) -> tuple[str, dict[str, bytes]]:
    """Return the hash of files, and the files with it in the place of HASH."""
    digest = hashlib.sha256()
    for member, data in sorted(template.items()):
        digest.update(f"{member}\0{len(data)}\0".encode() + data)
    content = digest.hexdigest()[:16]
    return content, {
        name.replace(HASH, content): data.replace(HASH.encode(), content.encode())
        for name, data in template.items()
    }


def write_members(target: Path, files: Mapping[str, bytes]) -> Built:
    """Write an FMU that holds these files, unless it is there already and holds the same."""
    there = target.is_file()
    before = read_members(target.read_bytes()) if there else {}
    if before == files:
        return Built(target, "unchanged")
    write_file(target, _archive(files))
    return Built(target, "changed", changes(before, files)) if there else Built(target, "new")


def _renamed(sources: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the sources as they stand in the FMU, all modules under names with HASH."""
    packages = sorted({name.partition("/")[0] for name in sources if "/" in name})
    imports = re.compile(rf"^from ({'|'.join(packages)})\b".encode(), re.MULTILINE)
    packed = {}
    for name, data in sources.items():
        package, _, rest = name.partition("/")
        place = f"{package}_{HASH}/{rest}" if rest else f"{Path(name).stem}_{HASH}.py"
        packed[f"resources/{place}"] = imports.sub(rf"from \1_{HASH}".encode(), data)
    return packed


@cache
def _linux_binary(bind_python: str | None) -> bytes:
    binary = mended((BINARIES / "linux64/libpythonfmu-export.so").read_bytes())
    return bound(binary, bind_python) if bind_python else binary


def _archive(members: Mapping[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in sorted(members.items()):
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))  # the same whenever it is built
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, data)
    return buffer.getvalue()
