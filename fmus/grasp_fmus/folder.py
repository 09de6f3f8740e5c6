"""The folder of built FMUs: its files, and a stamp that says whether they are up to date.

That takes a few milliseconds, without importing what builds. What the stamp holds: fmus/README.md.
"""

import json
import sys
from collections.abc import Iterable, Iterator
from hashlib import sha256
from pathlib import Path

from .package import Built as Built
from .package import card_file, package_folder, packages
from .package import write_file as write_file

STAMP = ".stamp.json"


def sources_hash() -> str:
    """Return the hash of all that decides what the FMUs and the files beside them hold.

    That is this package with its scripts and icons, the packages to pack with their cards,
    pythonfmu's binaries, the metadata of the distributions, and the version of Python.
    """
    digest = sha256(sys.version.encode())
    for name, file in _deciding():
        data = file.read_bytes()
        digest.update(f"\0{name}\0{len(data)}\0".encode() + data)
    return digest.hexdigest()


def is_current(folder: Path, sources: str) -> bool:
    """Return True if the folder holds what was built there from sources with this hash."""
    try:
        stamp = json.loads((folder / STAMP).read_bytes())
        return stamp["sources"] == sources and all(
            _file_hash(folder / name) == was for name, was in stamp["files"].items()
        )
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return False  # there is none, or it is damaged, or a file is missing


def write_stamp(folder: Path, sources: str, files: Iterable[str]) -> None:
    """Write the stamp of the files of these names, just built from sources with this hash."""
    stamp = {"sources": sources, "files": {f: _file_hash(folder / f) for f in sorted(files)}}
    write_file(folder / STAMP, json.dumps(stamp, indent=1).encode())


def _file_hash(file: Path) -> str:
    return sha256(file.read_bytes()).hexdigest()


def _deciding() -> Iterator[tuple[str, Path]]:
    """Yield the files, each with a name that does not depend on where it is installed."""
    for package, folder in packages(__package__).items():
        yield from _below(folder, package)
        if (card := card_file(package)).is_file():
            yield f"{package}: card", card
    yield from _below(package_folder("pythonfmu") / "resources" / "binaries", "pythonfmu")
    # Those whose version or licence is in an FMU, or that write a part of it
    for name in ("grasp_cosim", "markdown_it_py", "pythonfmu"):
        for folder in (f for entry in sys.path for f in Path(entry).glob(f"{name}-*.dist-info")):
            for file in ("METADATA", "licenses/LICENSE"):
                if (folder / file).is_file():
                    yield f"{folder.name}/{file}", folder / file


def _below(folder: Path, name: str) -> Iterator[tuple[str, Path]]:
    """Yield the files below a folder, but for what Python makes there."""
    for file in sorted(folder.rglob("*")):
        if file.is_file() and "__pycache__" not in file.parts:
            yield f"{name}/{file.relative_to(folder).as_posix()}", file
