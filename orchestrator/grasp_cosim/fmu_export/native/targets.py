"""The platforms that a native FMU may have a binary for."""

import struct
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

from ...base.platforms import platform_folder, platform_tuple

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
    chosen: dict[Target, None] = {}
    for name in names:
        if name not in NAMES:
            valid = ", ".join(NAMES)
            raise ValueError(f"--target {name!r}: must be of {valid}, with commas between")
        chosen |= dict.fromkeys(NAMES[name])
    return list(chosen)


def this_target() -> Target:
    """Return the platform of this Python."""
    name = platform_tuple()
    for target in KNOWN:
        if target.tuple == name:
            return target
    return Target(name, platform_folder(), zig="")


def folders(requested: Iterable[Target], fmi: Version) -> tuple[dict[Target, str], str]:
    """Return the folder in binaries/ of each target, and a note for the user of it, or "".

    This machine's binary is in, too, unless a target takes its folder: FMI 2.0 has one for both
    processors of a system. On macOS one file serves both; of two for Linux x86-64 has linux64.
    """
    target_here = this_target()
    targets = list(dict.fromkeys(requested))
    if fmi == 3:
        return {t: t.tuple for t in dict.fromkeys((target_here, *targets))}, ""
    if target_here.folder not in {t.folder for t in targets}:
        targets = [target_here, *targets]
    places = {t: t.folder for t in targets}
    if {LINUX_X86, LINUX_ARM} <= places.keys():
        places[LINUX_ARM] = LINUX_ARM.tuple
        return places, (
            "FMI 2.0 has one folder for both, linux64: x86_64-linux is there, aarch64-linux in a "
            "folder of that name, which few hosts look at; must be without linux64, or --fmi 3"
        )
    if target_here not in places:
        return places, (
            f"{target_here.folder} holds what was asked for, not {target_here.tuple}, this "
            "machine's: FMI 2.0 "
            "has one folder for both; --fmi 3 has two"
        )
    return places, ""


# A universal binary of macOS (<mach-o/fat.h>, big-endian): a head, an entry for each library, and
# the libraries, each from the beginning of a page on.
_FAT_HEAD = struct.Struct(">II")
"""Magic number, number of libraries."""
_FAT_MAGIC = 0xCAFEBABE
_FAT_ENTRY = struct.Struct(">IIIII")
"""Type and subtype of the processor, offset and size in bytes, alignment as a power of two."""
_PAGE_BITS = 14
_PAGE_BYTES = 1 << _PAGE_BITS
"""The pages of arm64, which are the larger ones."""
_THIN_PROCESSOR = struct.Struct("<II")
"""Type and subtype of the processor in a library for one (<mach-o/loader.h>, little-endian)."""
_THIN_PROCESSOR_OFFSET = 4
"""Bytes before them: the magic number."""


def universal(thin: Sequence[bytes]) -> bytes:
    """Return libraries for processors of macOS as one that serves them all."""
    head = _FAT_HEAD.pack(_FAT_MAGIC, len(thin))
    body = b""
    for binary in thin:
        cpu_type, cpu_subtype = _THIN_PROCESSOR.unpack_from(binary, _THIN_PROCESSOR_OFFSET)
        offset = _PAGE_BYTES + len(body)
        head += _FAT_ENTRY.pack(cpu_type, cpu_subtype, offset, len(binary), _PAGE_BITS)
        body += binary + bytes(-len(binary) % _PAGE_BYTES)
    return head.ljust(_PAGE_BYTES, b"\0") + body
