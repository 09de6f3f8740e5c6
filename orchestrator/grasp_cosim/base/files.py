"""Files that are written in one piece, and folders that can be written to."""

import errno
import json
import os
import tempfile
import threading
import zipfile
from contextlib import suppress
from glob import escape
from pathlib import Path
from shlex import quote
from typing import Any

from .errors import InputError
from .one_piece import in_one_piece, is_stream

CURRENT_FOLDER = threading.RLock()
"""Held by code that changes the current folder for a moment, as FMPy does to load a library, and by
code that goes back there: all threads have the same one.
"""

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Errors of a disk, not of the input."""

LIMITED = {
    errno.EMFILE: "this process has too many files open; `ulimit -n` permits more",
    errno.ENFILE: "this machine has too many files open",
    errno.ENOMEM: "there is no memory for it",
}
"""Errors that tell nothing of the file, in words."""

FMU_FOLDER = Path("fmus/build")
"""Where the FMUs of this project are built, below the current folder."""

NATIVE_FOLDER = Path("fmus/native")
"""Where native ones are built, below the current folder."""

PICTURES = ("png", "svg", "pdf")
"""The formats of pictures, by their suffixes."""


def check_folder(folder: Path) -> None:
    """InputError where files could not be written to the folder, which need not exist."""
    nearest = Path(os.path.realpath(folder))
    while not nearest.exists():
        nearest = nearest.parent
    try:
        with tempfile.TemporaryFile(dir=nearest):
            pass
    except OSError as error:
        raise InputError(f"{folder}: cannot write to {nearest}: {error.strerror}") from error


def make_folder(folder: Path) -> None:
    """Make a folder where there is none, also where a link leads to that is not there yet."""
    Path(os.path.realpath(folder)).mkdir(parents=True, exist_ok=True)


def check_file(path: Path) -> None:
    """InputError where a file could not be written at path: see one_piece.in_one_piece()."""
    if path.is_dir():
        raise InputError(f"{path}: is a folder; must be the name of a file")
    if not is_stream(path):
        check_folder((Path(os.path.realpath(path)) if path.is_symlink() else path).parent)
    elif not os.access(path, os.W_OK):
        raise InputError(f"{path}: cannot be written to; must be a file, or a stream that can")


WANTED = {
    "fmu": "an FMU, a file",
    "system": "a system, a .toml or .ssp file, or the run.json of a run",
    "run": "a folder that `grasp-cosim run --out` wrote",
    "block": "a block, a Python file",
}
"""The natures of files that a command may want, in words."""

_TAKEN = {
    "fmu": ("an FMU",), "system": ("a .toml file",), "run": (WANTED["run"], "a folder"),
    "block": ("a .py file",),
}  # fmt: skip
"""In the place of a run, the missing files of a folder are to be named."""

_OF_A_RUN = {"run.json", "signals.csv", "signals.arrow"}
_OF_AN_ARCHIVE = {"modelDescription.xml": "an FMU", "SystemStructure.ssd": "an SSP archive"}
_ADVICE = {
    WANTED["run"]: "`grasp-cosim report {}` shows the run",
    "a file of a run": "`grasp-cosim report {}` shows the run",
    "an FMU": "`grasp-cosim inspect {}` shows it, `grasp-cosim init my_system.toml --fmu NAME={}` "
    "makes a system of only this FMU, `--as COMPONENT={}` the grasp with it, "
    "`grasp-cosim run --swap COMPONENT={}` runs that",
    "an SSP archive": "`grasp-cosim run {}` runs it; its FMUs are in it, below resources/, and "
    "its name must end in .ssp",
    "a .toml file": "`grasp-cosim run {}` runs it, if it is a system",
    "a .py file": "`grasp-cosim build {}` makes an FMU of it, if it is a block",
    "a .csv file": "`grasp-cosim run --input {}` drives inputs of the grasp with it",
}
"""What to do with a file, {} for its name, or that of the folder of a run."""


def check_nature(path: Path, kind: str) -> None:
    """InputError where there is plainly something else than is wanted, a key of WANTED.

    It says what that is, and what to do with it. A file of an unknown content is not looked into.
    """
    nature = _nature(path)
    archive = kind == "system" and nature == "an SSP archive" and path.suffix.lower() == ".ssp"
    repeated = kind == "system" and nature == "a file of a run" and path.name == "run.json"
    if nature and nature not in _TAKEN[kind] and not archive and not repeated:
        name = path.parent if nature == "a file of a run" else path
        advice = _ADVICE.get(nature, "").replace("{}", quote(str(name)))
        message = f"must be {WANTED[kind]}{advice and '; '}{advice}"
        raise InputError(f"{path}: is {nature}; {message}")


def _nature(path: Path) -> str:
    """What there is, in words; empty where that is not plain."""
    if path.is_dir():
        return WANTED["run"] if (path / "run.json").is_file() else "a folder"
    if path.name in _OF_A_RUN and path.with_name("run.json").is_file():
        return "a file of a run"
    with suppress(OSError, ValueError, RuntimeError, NotImplementedError, zipfile.BadZipFile):
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                names = set(archive.namelist())
            return next((nature for file, nature in _OF_AN_ARCHIVE.items() if file in names), "")
    suffix = path.suffix.lower()
    is_plain = suffix in (".toml", ".py", ".csv", ".xml") and path.is_file()
    return f"a {suffix} file" if is_plain else ""


def check_fmu_file(path: Path) -> None:
    """InputError where there is no file at path, or plainly another one than an FMU."""
    check_nature(path, "fmu")
    if not path.is_file():
        raise InputError(f"{path}: no such FMU file")


def write_text(path: Path, text: str) -> None:
    """Write a file in one piece: there is never half of it."""
    with in_one_piece(path) as part:
        part.write_text(text, "utf-8", "backslashreplace")  # names that are no UTF-8


def write_json(path: Path, content: Any) -> None:
    """Write indented JSON in one piece."""
    write_text(path, json.dumps(content, indent=2) + "\n")


def remove(folder: Path, *names: str) -> None:
    """Remove files of these names, as far as there are any, and parts of them: see remove_parts().

    Before several files that belong together are written again: so there are none of two works.
    """
    for path in (folder / name for name in names):
        if not is_stream(path):  # nor a link, but the file that it names
            Path(os.path.realpath(path)).unlink(missing_ok=True)
    remove_parts(folder, *names)


def of_any_format(*stems: str) -> list[str]:
    """The names that pictures of these stems have."""
    return [f"{stem}.{suffix}" for stem in stems for suffix in PICTURES]


def remove_parts(folder: Path, *names: str) -> None:
    """Remove what a kill left of the writing of files of these names, which nobody writes now."""
    for name in names:
        for part in folder.glob(f"{escape(name)}.*.part"):
            part.unlink(missing_ok=True)


def not_its_fault(error: BaseException | str) -> str | None:
    """Why a file that may be sound cannot be read; None where it is to blame, or may be."""
    return LIMITED.get(error.errno or 0) if isinstance(error, OSError) else None


def unwritable(path: Path, error: OSError) -> str:
    """The message for a file that cannot be written."""
    return f"{path}: cannot be written: {error.strerror}"
