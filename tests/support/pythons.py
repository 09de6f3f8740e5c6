"""The Pythons on this machine."""

import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

VERSIONS = ["3.11", "3.12", "3.13", "3.14", "3.15"]

_ASK = (
    "import sys, sysconfig as s; print('{}.{}'.format(*sys.version_info), sys.base_prefix,"
    " *s.get_config_vars('LIBDIR', 'INSTSONAME'), s.get_path('stdlib'), sep='\\n')"
)


class Python(NamedTuple):
    """A Python, by what it says of itself."""

    program: str
    version: str
    folder: Path
    """Where its python3 is."""
    library: Path
    modules: Path

    @property
    def shared(self) -> bool:
        """Whether it has a libpython that can be loaded."""
        return ".so" in self.library.name and self.library.is_file()


@cache
def python(version: str, shared: bool = False) -> Python:
    """A Python of that version, with a shared libpython if wanted; skips the test without."""
    programs: list[Path | str | None] = [
        sys.executable,
        shutil.which(f"python{version}"),
        *sorted((Path.home() / ".pyenv/versions").glob(f"{version}.*/bin/python")),
    ]
    for candidate in (_asked(program) for program in programs if program):
        if candidate and candidate.version == version and (candidate.shared or not shared):
            return candidate
    kind = " WITH A SHARED LIBPYTHON" if shared else ""
    pytest.skip(f"PYTHON {version}{kind} IS NOT ON THIS MACHINE: the FMUs go untested with it")


def _asked(program: Path | str) -> Python | None:
    """What a program says of itself; a shim of pyenv may be of no Python at all."""
    done = subprocess.run([program, "-c", _ASK], capture_output=True, text=True)
    if done.returncode:
        return None
    version, prefix, folder, library, modules = done.stdout.splitlines()
    return Python(str(program), version, Path(prefix, "bin"), Path(folder, library), Path(modules))
