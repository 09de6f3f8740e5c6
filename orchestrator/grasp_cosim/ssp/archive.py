"""An archive, read and written in one piece, its FMUs as files meanwhile, and the notes on it.

The interface and the instances of an FMU need a file. Extracted FMUs go to a folder of this process
that is removed at its end, so that runs side by side do not meet. There they are filed by the hash
of their content, under their own last name: no path in an archive can lead out of the folder, and
an archive read twice is extracted once.
"""

import hashlib
import posixpath
import zipfile
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

from ..base.errors import InputError, choices, nearest
from ..base.one_piece import in_one_piece
from ..base.scratch import ScratchFolder
from ..base.zip_files import write_zip
from ..interface.model_description import check_size

SSD = ".ssd"
STRUCTURE = f"SystemStructure{SSD}"
RESOURCES = "resources/"
_OF_MACOS = {"__MACOSX/"}
"""What its archiver adds to a zip file."""


class Notes:
    """What was decided or passed over, and where; the same text of several places is one line."""

    def __init__(self) -> None:
        self.places: dict[str, dict[str, None]] = {}

    def add(self, place: str, text: str) -> None:
        """Note `text` of a place, once."""
        self.places.setdefault(text, {})[place] = None

    def lines(self) -> list[str]:
        """The notes in the order of their first places."""
        return [
            f"{next(iter(places))}: {text}" + (f" ({len(places)} such)" if len(places) > 1 else "")
            for text, places in self.places.items()
        ]


class Archive:
    """The entries of an .ssp file, or of another one that needs a certain entry, by paths.

    InputError where it is none. place names it in messages, by default the name of the file.
    """

    def __init__(self, path: Path, notes: Notes, place: str = "", needs: str = "") -> None:
        self.place = place or path.name
        label = place or str(path)
        try:
            self._file = zipfile.ZipFile(path)  # closed when nobody has the archive any more
            check_size(self._file, path)
        except FileNotFoundError:
            raise InputError(f"{label}: no such system file") from None
        except Exception as error:  # zipfile raises whatever it likes
            raise InputError(f"{label}: not readable as an SSP archive: {error}") from error
        self._label, self._notes = label, notes
        self._entries = _entries(self._file.namelist(), needs or STRUCTURE, self.place, notes)
        self._extracted: dict[str, Path] = {}
        if needs not in self._entries and (needs or not self.structures):
            raise InputError(f"{label}: no {needs or STRUCTURE} in it; must be an SSP archive")

    @property
    def names(self) -> tuple[str, ...]:
        """The paths of all entries."""
        return tuple(self._entries)

    @property
    def structures(self) -> tuple[str, ...]:
        """The structures at its top: SystemStructure.ssd and the variants of it."""
        return tuple(name for name in self.names if name.endswith(SSD) and "/" not in name)

    def structure(self, variant: str | None = None) -> str:
        """The variant of that name, or SystemStructure.ssd, or the only structure that it has.

        InputError where there is no such variant, or none of several is the one.
        """
        variants = [name.removesuffix(SSD) for name in self.structures]
        if variant is not None:
            name = variant.removesuffix(SSD)
            if name not in variants:
                valid = choices(variants)
                raise InputError(f"{self._label}: no variant {variant!r}; valid: {valid}")
            return f"{name}{SSD}"
        if STRUCTURE in self.structures:
            return STRUCTURE
        if len(variants) > 1:
            raise InputError(
                f"{self._label}: has no {STRUCTURE}, but the variants {choices(variants)}; must be "
                f"chosen: --set experiment.variant={variants[0]}"
            )
        return self.structures[0]

    def read(self, entry: str) -> bytes:
        """The content of an entry; InputError where it is damaged."""
        try:
            return self._file.read(self._entries[entry])
        except Exception as error:  # its decompressors, too
            reason = " ".join(str(error).split()) or type(error).__name__
            raise InputError(f"{self._label}: {entry}: not readable: {reason}") from error

    def resolve(self, place: str, uri: str, base: str = "") -> str:
        """The entry that a source names, a path relative to the folder `base` in the archive.

        InputError where there is none.
        """
        parts = urlsplit(uri)  # a valid URI by the schema
        if tuple(parts) != ("", "", parts.path, "", "") or not parts.path:
            raise InputError(f"{place}: source {uri!r}: must be the path of a file in the archive")
        for name in (unquote(parts.path), uri, uri.replace("\\", "/")):
            entry = posixpath.normpath(posixpath.join(base, name))
            if entry in self._entries:
                return entry
        lenient = posixpath.normpath(posixpath.join(base, unquote(parts.path).lstrip("/")))
        alike = [name for name in self.names if name.casefold() == lenient.casefold()]
        if len(alike) == 1:
            self._notes.add(place, f"source {uri!r} is taken to be {alike[0]}")
            return alike[0]
        suffix = posixpath.splitext(parts.path)[1]
        valid = [n for n in self.names if n.endswith(suffix) and not n.endswith("/")]
        raise InputError(f"{place}: source {uri!r}: not in the archive; {nearest(uri, valid)}")

    def extract(self, entry: str) -> Path:
        """The entry as a file, until the process ends."""
        if entry in self._extracted:
            return self._extracted[entry]
        data = self.read(entry)
        path = Path(_folder().name) / hashlib.sha256(data).hexdigest() / posixpath.basename(entry)
        if not path.exists():
            with in_one_piece(path) as part:
                part.write_bytes(data)
        self._extracted[entry] = path
        return path


def _entries(names: Iterable[str], needs: str, place: str, notes: Notes) -> dict[str, str]:
    """The names in the file by the paths that they mean.

    Some tools write backslashes, and zipping a folder puts all into one.
    """
    entries = {name.replace("\\", "/"): name for name in names}
    if any("\\" in name for name in entries.values()):
        notes.add(place, "its entries have backslashes, which are read as slashes")
    suffix = posixpath.splitext(needs)[1]
    if any(name.endswith(suffix) and "/" not in name for name in entries):
        return entries
    folders = {n.removesuffix(needs) for n in entries if n.endswith(f"/{needs}")}
    if not folders:
        folders = {f"{name.partition('/')[0]}/" for name in entries if "/" in name} - _OF_MACOS
    if len(folders) != 1:
        return entries
    folder = folders.pop()
    notes.add(place, f"all of it is in {folder}, which is read as the top")
    return {n.removeprefix(folder): name for n, name in entries.items() if n.startswith(folder)}


def write_archive(path: Path, entries: Mapping[str, bytes]) -> None:
    """Write the entries in the order given; the same entries give the same bytes."""
    with in_one_piece(path) as part:
        write_zip(part, entries)


@cache
def _folder() -> ScratchFolder:
    return ScratchFolder()
