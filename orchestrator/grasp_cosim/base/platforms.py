"""The platform of this Python as FMI names it, and the processor that an ELF file is for.

Standard library only.
"""

import platform
import sys
from functools import cache
from pathlib import Path

ELF_HEAD_BYTES = 20
"""Bytes at the beginning of an ELF file that say which processor it is for."""

_PROCESSORS = {3: "x86", 40: "ARM", 62: "x86-64", 183: "AArch64", 243: "RISC-V"}
"""By their number in ELF."""


def platform_tuple() -> str:
    """The platform as FMI 3.0 names its folder in binaries/: x86_64-linux."""
    processor = platform.machine().lower()
    processor = {"amd64": "x86_64", "arm64": "aarch64"}.get(processor, processor)
    return f"{processor}-{_system()}"


def platform_folder() -> str:
    """The platform as FMI 2.0 names its folder in binaries/: linux64, for any processor."""
    name = "win" if _system() == "windows" else _system()
    return f"{name}{sys.maxsize.bit_length() + 1}"


def _system() -> str:
    return {"win32": "windows"}.get(sys.platform, sys.platform)


def elf_processor(head: bytes) -> str:
    """The processor that an ELF file is for, by its first bytes; "" of another kind of file."""
    if head[:4] != b"\x7fELF" or len(head) < ELF_HEAD_BYTES:
        return ""
    number = int.from_bytes(head[18:20], "little")
    return _PROCESSORS.get(number, f"ELF machine {number}")


@cache
def python_processor() -> str:
    """The processor that this Python is for; "" where its binary is no ELF file."""
    with Path(sys.executable).open("rb") as binary:
        return elf_processor(binary.read(ELF_HEAD_BYTES))
