"""Builds the FMUs: stages a script and what it imports under content-hashed names, packs with
pythonfmu, and rewrites the archive so that the same content gives the same bytes.
"""

import hashlib
import os
import re
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from pythonfmu.builder import FmuBuilder

SCRIPTS = Path(__file__).parent / "scripts"
ADAPTER = ("__init__.py", "contract.py", "model_description.py", "slave.py")
"""What of this package runs inside an FMU."""

_IMPORT = re.compile(r"^from (\w+)", re.MULTILINE)
_EPOCH = (1980, 1, 1, 0, 0, 0)


def build(out: Path) -> list[Path]:
    """Build the FMUs into the folder out; returns their paths, in alphabetical order.

    An FMU that is there already with the same content is left alone.
    """
    return [build_fmu(script, out) for script in sorted(SCRIPTS.glob("*.py"))]


def build_fmu(script: Path, out: Path) -> Path:
    """Build the FMU of one script into the folder out and return its path."""
    sources = _sources(script)
    content = _content_hash(sources)
    target = out / f"{script.stem}.fmu"
    if _built_from(target) == content:
        return target
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="grasp_fmus_") as folder:
        stage = Path(folder)
        packages = _stage(sources, stage, content)
        staged = stage / f"{script.stem}_{content}.py"
        with _restored_imports():
            fmu = FmuBuilder.build_FMU(staged, dest=stage, project_files=packages)
        _repack(fmu, target)
    return target


def _sources(script: Path) -> dict[str, bytes]:
    """The script and the files of the packages it imports, by their path in the FMU."""
    text = script.read_text(encoding="utf-8")
    sources = {script.name: text.encode()}
    for package in dict.fromkeys(_IMPORT.findall(text)):
        spec = find_spec(package)
        if spec is None or spec.origin is None:
            raise ModuleNotFoundError(f"{script}: imports {package!r}, which is not installed")
        folder = Path(spec.origin).parent
        files = (
            [folder / name for name in ADAPTER] if package == __package__ else folder.rglob("*.py")
        )
        for file in sorted(files):
            sources[f"{package}/{file.relative_to(folder).as_posix()}"] = file.read_bytes()
    return sources


def _content_hash(sources: dict[str, bytes]) -> str:
    digest = hashlib.sha256(metadata.version("pythonfmu").encode())
    for name, data in sorted(sources.items()):
        digest.update(f"{name}\0{len(data)}\0".encode() + data)
    return digest.hexdigest()[:16]


def _stage(sources: dict[str, bytes], stage: Path, content: str) -> list[Path]:
    """Write the sources under hashed names: FMUs of one process share one sys.modules."""
    packages = dict.fromkeys(name.partition("/")[0] for name in sources if "/" in name)
    for name, data in sources.items():
        package, _, rest = name.partition("/")
        if rest:
            path = stage / f"{package}_{content}" / rest
        else:
            text = data.decode()
            for imported in packages:
                text = re.sub(rf"\b{imported}\b", f"{imported}_{content}", text)
            data = text.encode()
            path = stage / f"{Path(name).stem}_{content}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    return [stage / f"{package}_{content}" for package in packages]


@contextmanager
def _restored_imports() -> Iterator[None]:
    """Pythonfmu's builder imports what it packs; leave sys.path and sys.modules as they were."""
    path, modules = sys.path.copy(), set(sys.modules)
    try:
        yield
    finally:
        sys.path[:] = path
        for name in set(sys.modules) - modules:
            if re.search(r"_[0-9a-f]{16}\b", name):
                del sys.modules[name]


def _repack(fmu: Path, target: Path) -> None:
    """Write the archive again with sorted entries and one date, then move it into place."""
    part = target.with_name(f"{target.name}.{os.getpid()}.part")
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as copy:
        for name in sorted(source.namelist()):
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            copy.writestr(entry, source.read(name))
    part.replace(target)


def _built_from(fmu: Path) -> str | None:
    """The content hash of an FMU that is there already."""
    try:
        with zipfile.ZipFile(fmu) as archive:
            return archive.read("resources/slavemodule.txt").decode().rpartition("_")[2]
    except (OSError, KeyError, zipfile.BadZipFile):
        return None
