"""Zip archives of which the same entries give the same bytes. Standard library only."""

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO

_PERMISSIONS = 0o644 << 16
"""Of a file that its owner may write and all may read, as a zip archive has it."""

_UNIX = 3
"""The system whose permissions an archive has, in the numbers of zip archives."""


def write_zip(
    file: Path | IO[bytes], entries: Mapping[str, bytes], *, deflated: bool = False
) -> None:
    """Write the entries in their order: each as of 1980, from Unix, whatever the system is.

    They are stored as they are, or deflated.
    """
    with zipfile.ZipFile(file, "w") as archive:
        for name, data in entries.items():
            entry = zipfile.ZipInfo(name)  # of 1980
            entry.compress_type = zipfile.ZIP_DEFLATED if deflated else zipfile.ZIP_STORED
            entry.external_attr = _PERMISSIONS
            entry.create_system = _UNIX
            archive.writestr(entry, data)
