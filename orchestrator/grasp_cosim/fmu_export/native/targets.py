"""The platforms that a native FMU may have a binary for."""

import platform
import struct
import sys
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

Version = Literal[2, 3]
"""Of FMI."""


class Target(NamedTuple):
    """A platform, by the folder that FMI 3.0 names after it, and by that of FMI 2.0."""

    tuple: str
    folder: str
    zig: str
    """What zig calls it; empty where we do not know."""

    @property
    def suffix(self) -> str:
        """That of its shared libraries."""
        return {"windows": ".dll", "darwin": ".dylib"}.get(self.tuple.partition("-")[2], ".so")


LINUX_X86, WINDOWS, LINUX_ARM, MAC_X86, MAC_ARM = KNOWN = (
    Target("x86_64-linux", "linux64", "x86_64-linux-gnu.2.17"),
    Target("x86_64-windows", "win64", "x86_64-windows-gnu"),
    Target("aarch64-linux", "linux64", "aarch64-linux-gnu.2.17"),
    Target("x86_64-darwin", "darwin64", "x86_64-macos"),
    Target("aarch64-darwin", "darwin64", "aarch64-macos"),
)

NAMES: dict[str, tuple[Target, ...]] = {
    "linux64": (LINUX_X86,),
    "win64": (WINDOWS,),
    "darwin64": (MAC_X86, MAC_ARM),
    **{target.tuple: (target,) for target in KNOWN},
}
"""What a user may ask for: names of FMI 2.0, and of FMI 3.0."""


def targets(names: Iterable[str]) -> list[Target]:
    """Return the targets of these names, each once; ValueError for an unknown name."""
    found: dict[Target, None] = {}
    for name in names:
        if name not in NAMES:
            valid = ", ".join(NAMES)
            raise ValueError(f"--target {name!r}: must be of {valid}, with commas between")
        found |= dict.fromkeys(NAMES[name])
    return list(found)


def here() -> Target:
    """Return the platform of this Python."""
    processor = platform.machine().lower()
    processor = {"amd64": "x86_64", "arm64": "aarch64"}.get(processor, processor)
    system = {"win32": "windows"}.get(sys.platform, sys.platform)
    name = f"{processor}-{system}"
    folder = f"{'win' if system == 'windows' else system}64"
    return next((t for t in KNOWN if t.tuple == name), Target(name, folder, ""))


def folders(asked: Iterable[Target], fmi: Version) -> tuple[dict[Target, str], str]:
    """Return the folder in binaries/ of each target, and what is to be said of it, or "".

    This machine's binary is in, too, unless a target takes its folder: FMI 2.0 has one for both
    processors of a system. On macOS one file serves both; of two for Linux x86-64 has linux64.
    """
    wanted, ours = list(dict.fromkeys(asked)), here()
    if fmi == 3:
        return {t: t.tuple for t in dict.fromkeys((ours, *wanted))}, ""
    if ours.folder not in {t.folder for t in wanted}:
        wanted = [ours, *wanted]
    places = {t: t.folder for t in wanted}
    if {LINUX_X86, LINUX_ARM} <= places.keys():
        places[LINUX_ARM] = LINUX_ARM.tuple
        return places, (
            "FMI 2.0 has one folder for both, linux64: x86_64-linux is there, aarch64-linux in a "
            "folder of that name, which few hosts look at; must be without linux64, or --fmi 3"
        )
    if ours not in places:
        return places, (
            f"{ours.folder} holds what was asked for, not {ours.tuple}, this machine's: FMI 2.0 "
            "has one folder for both; --fmi 3 has two"
        )
    return places, ""


def universal(thin: Sequence[bytes]) -> bytes:
    """Return libraries for processors of macOS as one that serves them all."""
    page = 1 << 14
    head, body, place = struct.pack(">II", 0xCAFEBABE, len(thin)), b"", page
    for binary in thin:
        processor = struct.unpack_from("<II", binary, 4)
        head += struct.pack(">5I", *processor, place, len(binary), 14)
        body += binary + bytes(-len(binary) % page)
        place = page + len(body)
    return head + bytes(page - len(head)) + body
