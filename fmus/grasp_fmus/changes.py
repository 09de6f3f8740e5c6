"""Says what differs between an FMU that was built before and one built now."""

import io
import re
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from typing import Any
from xml.etree import ElementTree

DESCRIPTION = "modelDescription.xml"

_CONTENT_HASH = re.compile(rb"_[0-9a-f]{16}(?![0-9a-f])|(?:guid|instantiationToken)=.[0-9a-f]{16}")


def read_members(fmu: bytes) -> dict[str, bytes]:
    """Return the files in an FMU by name; none where it is damaged or no FMU."""
    try:
        with zipfile.ZipFile(io.BytesIO(fmu)) as archive:
            return {name: archive.read(name) for name in archive.namelist()}
    except (OSError, EOFError, ValueError, RuntimeError, zipfile.BadZipFile, zlib.error):
        return {}


def changes(before: Mapping[str, bytes], after: Mapping[str, bytes]) -> tuple[str, ...]:
    """Return a line for each variable and file that differs, from the files in an FMU.

    It says what was added, removed, or changed, and for a variable the value before.
    """
    try:
        old, new = _attributes(before[DESCRIPTION]), _attributes(after[DESCRIPTION])
    except (KeyError, ElementTree.ParseError):
        return ("what was there is no FMU",)
    return (*_changes(old, new), *_changes(_plain(before), _plain(after)))


def _changes(before: Mapping[str, Any], after: Mapping[str, Any]) -> Iterator[str]:
    """Yield a line for each name whose value differs, or for each attribute in the value."""
    for name, was, now in _differences(before, after):
        if was is None or now is None:
            yield f"{name}: {'added' if was is None else 'removed'}"
        elif isinstance(was, bytes):
            yield f"{name}: changed"
        else:
            for key, old, new in _differences(was, now):
                yield f"{name}: {key} {old or 'none'} -> {new or 'none'}"


def _differences(
    before: Mapping[str, Any], after: Mapping[str, Any]
) -> Iterator[tuple[str, Any, Any]]:
    """Yield names whose values differ, with both, in order; None where there is none."""
    for name in sorted({*before, *after}):
        if before.get(name) != after.get(name):
            yield name, before.get(name), after.get(name)


def _attributes(description: bytes) -> dict[str, dict[str, str]]:
    """Return the attributes of every variable by its name, its type's among them."""
    root = ElementTree.fromstring(description)  # noqa: S314 - of an FMU that was built here
    return {
        variable.get("name", ""): {
            **variable.attrib,
            **{k: v for t in variable for k, v in t.items()},
        }
        for variables in root.iter("ModelVariables")
        for variable in variables
    }


def _plain(members: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the files without content hashes in names and texts: they change with everything."""
    return {
        _CONTENT_HASH.sub(b"", name.encode()).decode(): data
        if name.startswith("binaries/")
        else _CONTENT_HASH.sub(b"", data)
        for name, data in members.items()
    }
