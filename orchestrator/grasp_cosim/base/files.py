"""Files that are written in one piece, and folders that can be written to."""

import errno
import json
import os
import tempfile
import zipfile
from contextlib import suppress
from glob import escape
from pathlib import Path
from shlex import quote
from typing import Any

from one_piece import in_one_piece, is_stream

from .errors import InputError

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Errors of a disk, not of the input."""

FMU_FOLDER = Path("fmus/build")
"""Where the FMUs of this project are built, below the current folder."""

NATIVE_FOLDER = Path("fmus/native")
"""Where native ones are built, below the current folder."""

PICTURES = ("png", "svg", "pdf")
"""The formats of pictures, by their suffixes."""


def check_folder(folder: Path) -> None:
    """InputError where files could not be written to the folder, which need not exist."""
    nearest = folder.absolute()
    while not nearest.exists():
        nearest = nearest.parent
    try:
        with tempfile.TemporaryFile(dir=nearest):
            pass
    except OSError as error:
        raise InputError(f"{folder}: cannot write to {nearest}: {error.strerror}") from error


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
    "system": "a system, a .toml or .ssp file",
    "run": "a folder that `grasp-cosim run --out` wrote",
}
"""The natures of files that a command may want, in words."""

_OF_A_RUN = {"run.json", "signals.csv", "signals.arrow"}
_OF_AN_ARCHIVE = {"modelDescription.xml": "an FMU", "SystemStructure.ssd": "an SSP archive"}
_OF_A_SUFFIX = {
    ".toml": ("a TOML file", "`grasp-cosim run {}` runs it, if it is a system"),
    ".py": ("a Python file", "`grasp-cosim build {}` makes an FMU of it, if it is a block"),
    ".csv": ("a CSV file", "`grasp-cosim run --input {}` drives inputs of the grasp with it"),
    ".xml": ("an XML file", ""),
}


def check_nature(path: Path, wanted: str) -> None:
    """InputError where there is plainly something else than is wanted, which says what to do then.

    wanted is a key of WANTED. A file of its suffix, or of an unknown content, is not looked into.
    """
    found, advice = _nature(path, wanted)
    if found not in ("", {"fmu": "an FMU", "run": WANTED["run"]}.get(wanted)):
        said = advice and "; " + advice.replace("{}", quote(str(path)))
        raise InputError(f"{path}: is {found}; must be {WANTED[wanted]}{said}")


def _nature(path: Path, wanted: str) -> tuple[str, str]:
    """The nature of a file, and what to do with it, {} for its name; empty where not plain."""
    folder = path if path.is_dir() else path.parent
    if (folder / "run.json").is_file() and (folder == path or path.name in _OF_A_RUN):
        what = WANTED["run"] if folder == path else "a file of a run"
        return what, f"`grasp-cosim report {quote(str(folder))}` shows the run"
    if folder == path:  # in the place of a run, what is missing in it is to be said
        return ("", "") if wanted == "run" else ("a folder", "")
    found = _archive_nature(path)
    if found == "an FMU" and wanted == "system":
        return found, (
            "`grasp-cosim init my_system.toml --fmu NAME={}` makes a system of it alone, "
            "`--as COMPONENT={}` the grasp with it, `grasp-cosim run --swap COMPONENT={}` runs that"
        )
    if found == "an FMU":
        return found, "`grasp-cosim inspect {}` shows it"
    suffix = path.suffix.lower()
    if found and wanted == "system":
        return ("", "") if suffix == ".ssp" else (found, "its name must end in .ssp")
    if found:
        return found, "`grasp-cosim run {}` runs it; its FMUs are in it, below resources/"
    own = {"system": ".toml", "run": ".csv", "fmu": ".csv"}[wanted]
    return _OF_A_SUFFIX.get(suffix, ("", "")) if suffix != own and path.is_file() else ("", "")


def _archive_nature(path: Path) -> str:
    """The nature of an archive by its content; empty for another file, or a damaged one."""
    with suppress(OSError, ValueError, RuntimeError, NotImplementedError, zipfile.BadZipFile):
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                names = set(archive.namelist())
            return next((what for file, what in _OF_AN_ARCHIVE.items() if file in names), "")
    return ""


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

    Before several files that belong together are written anew: so there are none of two works.
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


def unwritable(path: Path, error: OSError) -> str:
    """The message for a file that cannot be written."""
    return f"{path}: cannot be written: {error.strerror}"
