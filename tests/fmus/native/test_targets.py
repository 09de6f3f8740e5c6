"""Which folders of an FMU hold which binaries, on any machine."""

import platform
import struct
import sys

import pytest
from grasp_fmus.native.targets import (
    KNOWN,
    LINUX_ARM,
    LINUX_X86,
    MAC_ARM,
    MAC_X86,
    NAMES,
    WINDOWS,
    Target,
    folders,
    here,
    targets,
    universal,
)  # fmt: skip

Machine = tuple[str, str]
LINUX: Machine = ("linux", "x86_64")


def on(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", machine[0])
    monkeypatch.setattr(platform, "machine", lambda: machine[1])


@pytest.mark.parametrize(
    ("machine", "target"),
    [
        (LINUX, LINUX_X86),
        (("linux", "aarch64"), LINUX_ARM),
        (("win32", "AMD64"), WINDOWS),
        (("darwin", "arm64"), MAC_ARM),
        (("darwin", "x86_64"), MAC_X86),
        (("linux", "riscv64"), Target("riscv64-linux", "linux64", "")),
        (("win32", "ARM64"), Target("aarch64-windows", "win64", "")),
    ],
)
def test_this_machine(machine: Machine, target: Target, monkeypatch: pytest.MonkeyPatch) -> None:
    on(machine, monkeypatch)
    assert here() == target


@pytest.mark.parametrize(
    ("names", "found"),
    [
        (["linux64"], [LINUX_X86]),
        (["darwin64", "win64"], [MAC_X86, MAC_ARM, WINDOWS]),
        (["linux64", "x86_64-linux", "linux64"], [LINUX_X86]),
        (["aarch64-darwin"], [MAC_ARM]),
        ([], []),
    ],
)
def test_targets_have_the_names_of_both_versions(names: list[str], found: list[Target]) -> None:
    assert targets(names) == found


@pytest.mark.parametrize("name", ["linux", "", "win32", "LINUX64", " linux64"])
def test_an_unknown_target_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=r"--target '.*': must be of linux64, win64, .*") as error:
        targets(["win64", name])
    assert repr(name) in str(error.value)
    assert all(known in str(error.value) for known in NAMES)


@pytest.mark.parametrize(
    ("machine", "asked", "expected", "said"),
    [
        (LINUX, [], {LINUX_X86: "linux64"}, ""),
        (LINUX, [WINDOWS], {LINUX_X86: "linux64", WINDOWS: "win64"}, ""),
        (LINUX, [MAC_X86, MAC_ARM],
         {LINUX_X86: "linux64", MAC_X86: "darwin64", MAC_ARM: "darwin64"}, ""),
        (LINUX, [LINUX_ARM], {LINUX_ARM: "linux64"}, "not x86_64-linux, this machine's"),
        (LINUX, [LINUX_ARM, LINUX_X86], {LINUX_ARM: "aarch64-linux", LINUX_X86: "linux64"},
         "must be without linux64, or --fmi 3"),
        (("linux", "aarch64"), [], {LINUX_ARM: "linux64"}, ""),
        (("linux", "aarch64"), [LINUX_X86], {LINUX_X86: "linux64"}, "not aarch64-linux, this"),
        (("darwin", "arm64"), [], {MAC_ARM: "darwin64"}, ""),
        (("darwin", "arm64"), [MAC_X86, MAC_ARM], {MAC_X86: "darwin64", MAC_ARM: "darwin64"}, ""),
    ],
)  # fmt: skip
def test_fmi_2_has_a_folder_for_each_system(
    machine: Machine,
    asked: list[Target],
    expected: dict[Target, str],
    said: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    on(machine, monkeypatch)
    places, note = folders(asked, 2)
    assert places == expected
    assert said in note
    assert bool(said) == bool(note)
    assert len(note.splitlines()) <= 1


def test_fmi_3_has_a_folder_for_each_platform(monkeypatch: pytest.MonkeyPatch) -> None:
    on(LINUX, monkeypatch)
    assert folders([LINUX_ARM], 3) == (
        {LINUX_X86: "x86_64-linux", LINUX_ARM: "aarch64-linux"}, ""
    )  # fmt: skip
    assert folders(KNOWN, 3) == ({t: t.tuple for t in KNOWN}, "")


def test_one_library_for_both_processors_of_macos() -> None:
    """Mach-O files are told apart by their processor; each begins on a page."""
    thin = [struct.pack("<III", 0xFEEDFACF, cpu, sub) + bytes(n) for cpu, sub, n in
            ((0x01000007, 3, 5), (0x0100000C, 0, 20_000))]  # fmt: skip
    fat = universal(thin)
    magic, count = struct.unpack_from(">II", fat)
    assert (magic, count) == (0xCAFEBABE, 2)
    for i, binary in enumerate(thin):
        cpu, sub, place, size, align = struct.unpack_from(">5I", fat, 8 + 20 * i)
        assert (cpu, sub) == struct.unpack_from("<II", binary, 4)
        assert (place % (1 << align), fat[place : place + size]) == (0, binary)


def test_what_a_shared_library_is_called() -> None:
    assert [t.suffix for t in KNOWN] == [".so", ".dll", ".so", ".dylib", ".dylib"]
