"""Builds the FMUs: a script and what it imports, pythonfmu's binaries, description, documentation.

Everything in an FMU follows from the sources, and the same sources give the same bytes. All Python
FMUs of a process share one sys.modules, so every module is packed under a name that ends in a hash
of the whole content; the GUID is that hash.
"""

import hashlib
import importlib
import io
import os
import re
import sys
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any, Literal

import pythonfmu

from .binary import bound, libpython, mended, preamble
from .changes import changes, read_members
from .contract import declared, variables
from .cross_check import cross_check_files
from .documentation import icon, licences, page
from .model_description import Description, model_description

SCRIPTS = Path(__file__).parent / "scripts"
ADAPTER = (
    "__init__.py", "base.py", "contract.py", "host_log.py", "loader.py", "slave.py", "snapshot.py",
    "variable.py",
)  # fmt: skip
"""What of this package runs inside an FMU made from a block."""

BINARIES = Path(pythonfmu.__file__).parent / "resources" / "binaries"
HASH = "CONTENT_HASH"
"""Stands for the content hash until it is known."""

IMPORT = re.compile(r"^from (\w+)", re.MULTILINE)
"""An import in a script."""

_DATE = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True, slots=True)
class Built:
    """An FMU in its folder, and what building it changed there."""

    path: Path
    status: Literal["new", "changed", "unchanged"]
    changes: tuple[str, ...] = ()
    """Files in the FMU, and attributes of its variables, that are not what they were."""


def build(out: Path, bind_python: str | None = None) -> list[Built]:
    """Build the FMUs into the folder out, in alphabetical order, with their cross-check files.

    bind_python is a Python executable to whose libpython the FMUs are bound, for hosts that are not
    Python. An FMU that is there already with the same content is left alone. One that needs other
    packages has no cross-check files: it would be these that they check, and only where they are.
    """
    built = []
    for script in sorted(SCRIPTS.glob("*.py")):
        built.append(build_fmu(script, out, bind_python))
        slave = _slave(script)
        files = {} if slave.requires else cross_check_files(script.stem, slave.block)
        for name, data in files.items():
            if not (out / name).is_file() or (out / name).read_bytes() != data:
                write_file(out / name, data)
    return built


def build_fmu(script: Path, out: Path, bind_python: str | None = None) -> Built:
    """Build the FMU of one script into the folder out, like build(), but nothing beside it."""
    slave = _slave(script)
    name, summary = script.stem, (slave.__doc__ or "").rstrip(".")
    description = Description(name, summary, variables(declared(slave.block)))
    html = page(
        name,
        summary,
        _card(slave.block),
        metadata.version("grasp-cosim"),
        bound_library(bind_python),
        requires=slave.requires,
    )
    template = members(description, html, icon(name), _sources(script), bind_python)
    return write_fmu(template, out / f"{name}.fmu")


def members(
    description: Description,
    html: str,
    picture: bytes | None,
    sources: Mapping[str, bytes],
    bind_python: str | None,
) -> dict[str, bytes]:
    """The files of an FMU, with HASH in the place of the content hash.

    picture is its icon, if it has one. sources are its script NAME.py and, by their paths, the
    files of the packages that it imports.
    """
    name = description.name
    script = f"{name}.py"
    if bind_python:
        sources = {**sources, script: preamble(bind_python).encode() + sources[script]}
    return {
        "modelDescription.xml": model_description(description, HASH),
        **({"model.png": picture} if picture else {}),
        "documentation/index.html": html.encode(),
        **{f"documentation/licenses/{file}": text for file, text in licences().items()},
        f"binaries/linux64/{name}.so": _linux_binary(bind_python),
        f"binaries/win64/{name}.dll": _binary("win64/pythonfmu-export.dll"),
        "resources/slavemodule.txt": f"{name}_{HASH}".encode(),
        **_packed(sources),
    }


def write_fmu(template: Mapping[str, bytes], target: Path) -> Built:
    """Write an FMU of these files, where it is not there already with the same content."""
    content = _content_hash(template)
    files = {
        name.replace(HASH, content): data.replace(HASH.encode(), content.encode())
        for name, data in template.items()
    }
    if not target.exists():
        built = Built(target, "new")
    elif (before := read_members(target)) == files:
        return Built(target, "unchanged")
    else:
        built = Built(target, "changed", changes(before, files))
    write_file(target, _archive(files))
    return built


def own_files(names: Sequence[str]) -> dict[str, bytes]:
    """Files of this package, by their path in an FMU."""
    folder = _folder(__package__)
    return {f"{__package__}/{name}": (folder / name).read_bytes() for name in names}


def _slave(script: Path) -> Any:
    """The class in a script, which has the script's name."""
    spec = spec_from_file_location(script.stem, script)
    if spec is None or spec.loader is None:
        raise ImportError(f"{script}: must be a Python file")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, script.stem)


def _sources(script: Path) -> dict[str, bytes]:
    """The script and the files of the packages it imports, by their path."""
    text = script.read_bytes()
    sources = {script.name: text}
    for package in dict.fromkeys(IMPORT.findall(text.decode())):
        sources |= package_files(package)
    return sources


def package_files(package: str) -> dict[str, bytes]:
    """The files of a package by their path in an FMU; of this one, what runs in there."""
    if package == __package__:
        return own_files(ADAPTER)
    folder = _folder(package)
    return {
        f"{package}/{file.relative_to(folder).as_posix()}": file.read_bytes()
        for file in sorted(folder.rglob("*.py"))
    }


def _folder(package: str) -> Path:
    return Path(importlib.import_module(package).__file__ or "").parent


def _packed(sources: Mapping[str, bytes]) -> dict[str, bytes]:
    """The sources as they stand in the FMU, all modules under names with HASH."""
    packages = {name.partition("/")[0] for name in sources if "/" in name}
    imports = re.compile(rf"^from ({'|'.join(sorted(packages))})\b", re.MULTILINE)
    packed = {}
    for name, data in sources.items():
        package, _, rest = name.partition("/")
        if rest:
            packed[f"resources/{package}_{HASH}/{rest}"] = data
        else:
            text = imports.sub(rf"from \1_{HASH}", data.decode())
            packed[f"resources/{Path(name).stem}_{HASH}.py"] = text.encode()
    return packed


def _card(block: Any) -> str:
    """The equation card of a block: in the package once installed, beside it in the sources."""
    folder = Path(sys.modules[block.__package__].__file__ or "").parent
    inside = folder / "README.md"
    return (inside if inside.exists() else folder.parent / "README.md").read_text("utf-8")


def bound_library(bind_python: str | None) -> Path | None:
    """The libpython to which FMUs are bound; None where they are not."""
    return libpython(bind_python) if bind_python else None


def _binary(name: str) -> bytes:
    return (BINARIES / name).read_bytes()


@cache
def _linux_binary(bind_python: str | None) -> bytes:
    binary = mended(_binary("linux64/libpythonfmu-export.so"))
    return bound(binary, bind_python) if bind_python else binary


def _content_hash(members: Mapping[str, bytes]) -> str:
    digest = hashlib.sha256()
    for name, data in sorted(members.items()):
        digest.update(f"{name}\0{len(data)}\0".encode() + data)
    return digest.hexdigest()[:16]


def _archive(members: Mapping[str, bytes]) -> bytes:
    """A ZIP file with sorted entries and one date."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in sorted(members.items()):
            entry = zipfile.ZipInfo(name, _DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, data)
    return buffer.getvalue()


def write_file(target: Path, data: bytes) -> None:
    """Write a file in one piece, with its folder; OSError names the target."""
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f"{target.name}.{os.getpid()}.part")
    try:
        part.write_bytes(data)
        part.replace(target)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(target)) from error
    finally:
        part.unlink(missing_ok=True)
