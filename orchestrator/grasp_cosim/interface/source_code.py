"""Whether the C of an FMU can be compiled to a binary that hosts load, by its files.

`fmpy compile` has CMake compile the files that the FMU lists. A host asks the binary for functions
of their plain names; sources for static linking give them a prefix.
"""

import re
import zipfile
from collections.abc import Mapping
from pathlib import PurePosixPath
from xml.parsers.expat import ExpatError

from .interface import Interface
from .model_description import NAME, parsed

FOLDER = "sources/"
BUILD = f"{FOLDER}buildDescription.xml"
SUFFIXES = (".c", ".h", ".cc", ".cpp", ".cxx", ".hpp")
HEADERS = ("Functions.h", "FunctionTypes.h", "PlatformTypes.h", "TypesPlatform.h")
"""The ends of the names of the standard's headers, fmi2Functions.h and so on, which FMPy has."""

_INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]+"([^"]+)"', re.MULTILINE)
_PREFIX = re.compile(r"^[ \t]*#[ \t]*define[ \t]+FMI[23]_FUNCTION_PREFIX[ \t]+(\w+)", re.MULTILINE)


def why_not_compiled(fmu: Interface) -> str:
    """What is seen to be missing to compile the sources of an FMU; empty where nothing is."""
    with zipfile.ZipFile(fmu.path) as archive:
        names = {name for name in archive.namelist() if name.startswith(FOLDER)}
        texts = {
            name: archive.read(name).decode(errors="replace")
            for name in sorted(names)
            if name.endswith(SUFFIXES)
        }
        place = BUILD if fmu.version.startswith("3") else NAME
        if place not in archive.namelist():
            return f"there is no {place}"
        try:
            root = parsed(archive.read(place))
        except (ValueError, ExpatError) as error:
            return f"{place} cannot be read: {error}"
    element = "SourceFile" if place == BUILD else "SourceFiles/File"
    files = [file.get("name", "") for file in root.iterfind(f".//{element}")]
    if not files:
        return f"{place} lists no source files"
    for name in files:
        if FOLDER + name not in names:
            return f"{place} lists {name}, which is not there"
    return _lacking_header(texts) or _prefix(texts, fmu.identifier)


def _lacking_header(texts: Mapping[str, str]) -> str:
    """A file that a source includes and that is not there; empty where there is none."""
    packed = {PurePosixPath(name).name for name in texts}
    for name, text in texts.items():
        for header in _INCLUDE.findall(text):
            file = PurePosixPath(header).name
            if file not in packed and not file.endswith(HEADERS):
                return f"{name} includes {header}, which is not there"
    return ""


def _prefix(texts: Mapping[str, str], identifier: str) -> str:
    """The prefix of the functions, unless CMake leaves it out; empty where there is none."""
    for name, text in texts.items():
        prefix = _PREFIX.search(text)
        if prefix and f"{identifier}_EXPORTS" not in text:
            return f"{name} puts {prefix[1]} before the names of the functions, which hosts do not"
    return ""
