"""Makes play.wasm.z, which the page carries: the C of our native FMUs, and the loop over them.

It takes the zig that ZIG names, which makes the same bytes on every machine. The file is kept next
to its sources, so that the page needs no compiler. It names its sources, so that a test finds
without zig whether these are the sources at hand.
"""

import re
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Mapping
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from grasp_cosim.base.c_compilers import BITS, LIBM, environment, find_zig
from grasp_cosim.base.checks import install_command
from grasp_cosim.base.errors import InputError
from grasp_cosim.fmu_export.native.blocks import translated
from grasp_cosim.fmu_export.native.sources import native_sources
from grasp_cosim.fmu_export.package import Model, shipped_model, write_file
from grasp_cosim.grasp.system import CONTROLLERS

PLANTS = {
    "fixed": "GripperPlant",
    "soft": "GripperPlantCompliant",
    "movable": "GripperPlantMovable",
}
"""The plants to choose from, by what the object does."""

LAWS = {name: f"GraspController{law}" for name, law in CONTROLLERS.items()}

MODELS = (*PLANTS.values(), "ProximitySensor", *LAWS.values())
"""The FMUs that are in play.wasm, in the order of its kinds."""

WASM = Path(__file__).with_name("play.wasm.z")
"""The components in WebAssembly, deflated, as pages have it."""

ZIG = "0.17.1"
GUID = "playground"
CONTENT = "0" * 16
"""Of an FMU in Python with which states are exchanged: none are."""

MARK = b"sources sha256 "
"""Before the hash of the sources, in the wasm."""

EXPORTS = (
    "play_begin", "play_columns", "play_component", "play_connect", "play_record", "play_run",
    "play_set", "play_sources", "play_text",
)  # fmt: skip

OPTIONS = (
    *BITS, "-Os", *(f"-fno-builtin-{function}" for function in LIBM), "-target", "wasm32-wasi",
    "-mexec-model=reactor", "-Wl,--strip-all", *(f"-Wl,--export={name}" for name in EXPORTS),
    "-o", "play.wasm", "play.c", *(f"{name}/{name}.c" for name in MODELS), f"-I{MODELS[0]}",
)  # fmt: skip
"""Of the compiler. The last folder has the headers of FMI, which are the same in all."""

_UNSEEN = re.compile(rb"/\*.*?\*/|\s+", re.DOTALL)
"""Comments and white space, which no C compiler minds."""


@cache
def model(name: str) -> Model:
    """Return the model of an FMU that comes with the package."""
    return shipped_model(name)


def shipped() -> bytes:
    """Return play.wasm.z as it is."""
    return WASM.read_bytes()


def sources() -> dict[str, bytes]:
    """Return all files of C by name, those of each FMU in a folder of its name."""
    found = {"play.c": Path(__file__).with_name("play.c").read_bytes()}
    for name in MODELS:
        translation = translated(name, model(name).block)
        of_fmu = native_sources(name, translation, CONTENT, GUID, 2)
        found |= {f"{name}/{file}": data for file, data in of_fmu.items()}
    kinds = " ".join(f"EACH({name})" for name in MODELS)
    found["kinds.h"] = f'#define GUID "{GUID}"\n#define KINDS(EACH) {kinds}\n'.encode()
    found["kinds.h"] += f'#define SOURCES "{_hash(found)}"\n'.encode()
    return found


def _hash(found: Mapping[str, bytes]) -> str:
    """Return a hash of all that decides the wasm, so not of comments."""
    digest = sha256(repr((ZIG, OPTIONS)).encode())
    for name, data in sorted(found.items()):
        digest.update(f"\0{name}\0".encode() + _UNSEEN.sub(b" ", data))
    return digest.hexdigest()[:32]


def made_from(wasm: bytes) -> str:
    """Return the hash of the sources that a wasm was made from; empty where it does not say."""
    return wasm.partition(MARK)[2][:32].decode("ascii", "replace")


def hash_at_hand() -> str:
    """Return the hash of the sources as they are now."""
    return sources()["kinds.h"].rpartition(b"SOURCES")[2].strip().strip(b'"').decode()


def made() -> bytes:
    """Return the wasm, made now; InputError where zig is missing, another version, or fails."""
    try:
        found = version("ziglang")
    except PackageNotFoundError:
        found = "missing"
    zig = find_zig()
    if zig is None or found != ZIG:
        raise InputError(
            f"ziglang: {found}; must be {ZIG}, which makes the same bytes everywhere: "
            f"{install_command(f'ziglang=={ZIG}')}"
        )
    with tempfile.TemporaryDirectory() as folder:
        for name, data in sources().items():
            file = Path(folder, name)
            file.parent.mkdir(exist_ok=True)
            file.write_bytes(data)
        done = subprocess.run(  # noqa: S603 - zig of its package
            [*zig.command, *OPTIONS], cwd=folder, env=environment(Path(folder)),
            stdin=subprocess.DEVNULL, capture_output=True, check=False,
        )  # fmt: skip
        if done.returncode:
            said = done.stderr.decode("utf-8", "replace").strip().splitlines() or ["no message"]
            raise InputError(f"zig: exit code {done.returncode}: {said[0]}")
        return Path(folder, "play.wasm").read_bytes()


def main() -> None:
    """Write play.wasm.z again where it is not of the sources at hand."""
    if WASM.is_file() and made_from(zlib.decompress(shipped())) == hash_at_hand():
        return
    try:
        write_file(WASM, zlib.compress(made(), 9))
    except InputError as error:
        sys.exit(str(error))
