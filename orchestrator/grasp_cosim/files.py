"""Files that are written in one piece, and folders that can be written to."""

import errno
import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from glob import escape
from pathlib import Path
from typing import Any

from .errors import InputError

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Errors of a disk, not of the input."""

FMU_FOLDER = Path("fmus/build")
"""Where the FMUs of this project are built, below the current folder."""

NATIVE_FOLDER = Path("fmus/native")
"""Where native ones are built, below the current folder."""


def check_folder(folder: Path) -> None:
    """InputError where files could not be written to the folder, which need not exist."""
    nearest = folder.absolute()
    while not nearest.exists():
        nearest = nearest.parent
    try:
        with tempfile.TemporaryFile(dir=nearest):
            pass
    except OSError as error:
        raise InputError(f"--out {folder}: cannot write to {nearest}: {error.strerror}") from error


def check_fmu_file(path: Path) -> None:
    """InputError where there is no file at path."""
    if path.is_dir():
        raise InputError(f"{path}: is a folder; must be an FMU, a file")
    if not path.is_file():
        raise InputError(f"{path}: no such FMU file")


def write_text(path: Path, text: str) -> None:
    """Write a file in one piece: there is never half of it."""
    with in_one_piece(path) as part:
        part.write_text(text, encoding="utf-8")


def write_json(path: Path, content: Any) -> None:
    """Write indented JSON in one piece."""
    write_text(path, json.dumps(content, indent=2) + "\n")


@contextmanager
def in_one_piece(path: Path) -> Iterator[Path]:
    """A temporary name beside path to write to; it takes the place of path at the end."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        yield part
        part.replace(path)
    except OSError as error:  # a write that fails does not say where, or where it is for now
        if error.errno is None or error.filename not in (None, part, str(part)):
            raise
        raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
    finally:
        part.unlink(missing_ok=True)


def remove(folder: Path, *names: str) -> None:
    """Remove files of these names, as far as there are any, and parts of them: see remove_parts().

    Before several files that belong together are written anew: so there are none of two works.
    """
    for name in names:
        (folder / name).unlink(missing_ok=True)
    remove_parts(folder, *names)


def remove_parts(folder: Path, *names: str) -> None:
    """Remove what a kill left of the writing of files of these names, which nobody writes now."""
    for name in names:
        for part in folder.glob(f"{escape(name)}.*.part"):
            part.unlink(missing_ok=True)


def unwritable(path: Path, error: OSError) -> str:
    """The message for a file that cannot be written."""
    return f"{path}: cannot be written: {error.strerror}"
