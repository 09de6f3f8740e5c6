"""The modelDescription.xml of an FMU as a tree; an archive or document made to do harm is refused.

Limits are checked before anything is unpacked: what the directory of the archive says is all that
its files can yield.
"""

import re
import zipfile
from pathlib import Path
from typing import Any, NoReturn
from xml.etree import ElementTree
from xml.parsers import expat

from ..base.errors import InputError
from ..base.files import check_fmu_file, not_its_fault
from ..base.platforms import ELF_HEAD_BYTES

NAME = "modelDescription.xml"
MAX_DESCRIPTION_BYTES = 100_000_000
"""Bytes of a modelDescription.xml: some 300,000 variables, more than the largest FMUs have."""
MAX_UNPACKED_BYTES, MAX_EXPANSION = 500_000_000, 50
"""Bytes of all files, allowed beyond that if the archive is at least one 50th as large: binaries
and tables pack 2 to 20 times, a bomb hundreds of times."""
MAX_DEPTH = 256
"""Elements within each other: the standard needs 6, the annotations of tools some more."""
ENCRYPTED = 1
"""The flag of an entry of a zip file that is encrypted."""
_BINARY = re.compile(r"binaries/linux64/[^/]+\.so")
MAX_XML_ELEMENTS = 1_000_000
"""Two or three to a variable."""


def read_document(path: Path) -> tuple[ElementTree.Element, dict[str, bytes]]:
    """Return the root of the description in the FMU at `path`, and its files by their names.

    Of a binary for Linux that is its head, of another file nothing.

    InputError where there is no FMU.
    """
    check_fmu_file(path)
    try:
        with zipfile.ZipFile(path) as archive:
            entries = _checked_entries(archive)
            check_size(archive, path)
            root = parsed(archive.read(NAME))
            files = dict.fromkeys(entries, b"")
            for name in filter(_BINARY.fullmatch, entries):
                with archive.open(entries[name]) as file:
                    files[name] = file.read(ELF_HEAD_BYTES)
        if not root.get("fmiVersion"):
            raise ValueError(f"no fmiVersion in {NAME}")
    except Exception as error:  # zipfile and its decompressors raise whatever they like
        raise unreadable(path, error) from error
    return root, files


def _checked_entries(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """The entries by name; ValueError where one may do harm, or there is no description."""
    for entry in archive.infolist():
        if entry.flag_bits & ENCRYPTED:
            raise ValueError(
                f"{entry.filename} is encrypted; ask the vendor for it without a password"
            )
    entries = {entry.filename.replace("\\", "/"): entry for entry in archive.infolist()}
    for name in entries:
        if name.startswith("/") or ".." in name.split("/"):
            raise ValueError(f"{name} leads out of the archive; must be the path of a file in it")
    if NAME not in entries:
        alike = next((name for name in entries if name.lower().endswith(NAME.lower())), None)
        advice = "" if alike is None else f"; must be there, and called so: there is {alike}"
        raise ValueError(f"no {NAME} at the top of the archive{advice}")
    size = entries[NAME].file_size
    if size > MAX_DESCRIPTION_BYTES:
        raise ValueError(f"{NAME} has {size} bytes; must have at most {MAX_DESCRIPTION_BYTES}")
    return entries


def check_size(archive: zipfile.ZipFile, path: Path) -> None:
    """ValueError where the files of the archive at `path` would be too large, unpacked."""
    total = sum(i.file_size for i in archive.infolist())
    limit = max(MAX_UNPACKED_BYTES, MAX_EXPANSION * path.stat().st_size)
    if total > limit:
        raise ValueError(f"its files have {total} bytes unpacked; must have at most {limit}")


def unreadable(path: Path, error: Exception | str) -> InputError:
    """The one line for an FMU that cannot be read."""
    if limit := not_its_fault(error):
        return InputError(f"{path}: cannot be read: {limit}")
    reason = " ".join(str(error).split()) or type(error).__name__
    return InputError(f"{path}: not a readable FMU: {reason}")


def parsed(text: bytes) -> ElementTree.Element:
    """The root; of all at once, since expat reads a long name again with each piece."""
    if text.count(b"<") - text.count(b"</") > MAX_XML_ELEMENTS:  # as cheap as can be
        raise ValueError(f"{NAME} has more than {MAX_XML_ELEMENTS} elements")
    builder = ElementTree.TreeBuilder()
    parser = expat.ParserCreate(None, "}")

    def refuse(name: str, *_: Any) -> NoReturn:
        raise ValueError(f"{NAME} has a document type {name!r}, which may define entities")

    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = builder.data, refuse
    parser.Parse(text, True)
    root = builder.close()
    _check_depth(root)
    return root


def _check_depth(root: ElementTree.Element) -> None:
    """ValueError where elements are too deep within each other."""
    level = [root]
    for _ in range(MAX_DEPTH):
        level = [inner for element in level for inner in element]
    if level:
        raise ValueError(f"{level[0].tag} in {NAME} is more than {MAX_DEPTH} elements deep")
