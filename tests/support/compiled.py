"""Compiles the C of tests, and packs that of test FMUs; what was compiled is kept between runs."""

import os
import shutil
import subprocess
import tempfile
import zipfile
from functools import cache
from hashlib import sha256
from pathlib import Path

import fmpy

HEADERS = Path(fmpy.__file__).with_name("c-code")


def compile_c(command, out):
    """What the compiler makes of C files at out, unless it has made it before, then that again.

    It must say nothing. The same are the same options and, after the preprocessor, the same text.
    """
    program = shutil.which(command[0])
    assert program is not None
    plain = [str(word) for word in command]
    text = subprocess.run([*plain, "-w", "-E", "-P"], check=True, capture_output=True).stdout
    options = [word for word in plain if not word.startswith(("-I", "-D", "/"))]
    version = os.path.realpath(program), Path(program).stat().st_mtime_ns
    name = sha256(repr((options, version, text)).encode()).hexdigest()
    kept = Path(os.environ["XDG_CACHE_HOME"], "compiled", name)
    if not kept.exists():
        kept.parent.mkdir(parents=True, exist_ok=True)
        part = kept.with_suffix(f".{os.getpid()}")
        done = subprocess.run([*plain, "-o", part], capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")
        part.replace(kept)
    shutil.copy(kept, out)
    return out


@cache
def shared_library(*sources, code="", options=("-lm",), asked=None):
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
        command += [*map(str, sources), str(more), str(rest), *options]
        return compile_c(command, out).read_bytes()


def pack(path, version, name, description, library):
    """The FMU at path, with a library of that name for this machine unless that is empty."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        if library:
            archive.writestr(binary(version, name), library)
        archive.writestr("resources/", "")
    return path


def binary(version, name):
    """Where an FMU of that version of FMI has its library for this machine."""
    platform = fmpy.platform if version == "2.0" else fmpy.platform_tuple
    return f"binaries/{platform}/{name}{fmpy.sharedLibraryExtension}"
