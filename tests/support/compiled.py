"""Compiles the C of test FMUs with gcc, each once in a test process, and packs it as an FMU."""

import subprocess
import tempfile
import zipfile
from functools import cache
from pathlib import Path

import fmpy

HEADERS = Path(fmpy.__file__).with_name("c-code")


@cache
def shared_library(
    *sources: Path, code: str = "", options: tuple[str, ...] = ("-lm",), asked: type | None = None
) -> bytes:
    """The library of these sources, and of more code; options come behind them.

    With asked, a class of FMPy, it has all functions that this looks for: what the sources lack
    fails.
    """
    names = [n for n in dir(asked) if n.startswith(("fmi2", "fmi3"))] if asked else []
    lacked = (f"__attribute__((weak)) int {n}(void) {{ return 3; }}\n" for n in names)
    with tempfile.TemporaryDirectory() as folder:
        out, more, rest = Path(folder, "out.so"), Path(folder, "more.c"), Path(folder, "rest.c")
        more.write_text(code, "utf-8")
        rest.write_text("".join(lacked), "utf-8")
        command = ["gcc", "-shared", "-fPIC", "-O1", "-ffp-contract=off", f"-I{HEADERS}"]
        command += [*map(str, sources), str(more), str(rest), *options, "-o", str(out)]
        subprocess.run(command, check=True)
        return out.read_bytes()


def pack(path: Path, version: str, name: str, description: str, library: bytes) -> Path:
    """The FMU at path, with a library of that name for this machine unless that is empty."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        if library:
            archive.writestr(binary(version, name), library)
        archive.writestr("resources/", "")
    return path


def binary(version: str, name: str) -> str:
    """Where an FMU of that version of FMI has its library for this machine."""
    platform = fmpy.platform if version == "2.0" else fmpy.platform_tuple
    return f"binaries/{platform}/{name}{fmpy.sharedLibraryExtension}"
