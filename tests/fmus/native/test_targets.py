"""Which folders of an FMU hold which binaries, on any machine."""

import platform
import sys

import pytest
from grasp_cosim.fmu_export.native.targets import (
    KNOWN,
    NAMES,
    Target,
    folders,
    targets,
    this_target,
)

LINUX_X86, WINDOWS, LINUX_ARM, MAC_X86, MAC_ARM = KNOWN
LINUX = ("linux", "x86_64")
ON_ARM = ("linux", "aarch64")
MAC = ("darwin", "arm64")
BOTH = [MAC_X86, MAC_ARM]


def on(machine, monkeypatch):
    monkeypatch.setattr(sys, "platform", machine[0])
    monkeypatch.setattr(platform, "machine", lambda: machine[1])


@pytest.mark.parametrize(
    ("machine", "target", "suffix"),
    [
        (LINUX, LINUX_X86, ".so"),
        (ON_ARM, LINUX_ARM, ".so"),
        (("win32", "AMD64"), WINDOWS, ".dll"),
        (MAC, MAC_ARM, ".dylib"),
        (("darwin", "x86_64"), MAC_X86, ".dylib"),
        (("linux", "riscv64"), Target("riscv64-linux", "linux64", ""), ".so"),
        (("win32", "ARM64"), Target("aarch64-windows", "win64", ""), ".dll"),
    ],
)
def test_this_machine(machine, target, suffix, monkeypatch):
    on(machine, monkeypatch)
    assert (this_target(), this_target().suffix) == (target, suffix)


@pytest.mark.parametrize(
    ("names", "found"),
    [
        (["linux64"], [LINUX_X86]),
        (["darwin64", "win64"], [*BOTH, WINDOWS]),
        (["linux64", "x86_64-linux", "linux64"], [LINUX_X86]),
        ([], []),
    ],
)
def test_targets_have_the_names_of_both_versions(names, found):
    assert targets(names) == found


@pytest.mark.parametrize("name", ["", "LINUX64", " linux64"])
def test_an_unknown_target_is_refused(name):
    with pytest.raises(ValueError, match=f"^--target '{name}': must be of {', '.join(NAMES)}, "):
        targets(["win64", name])


@pytest.mark.parametrize(
    ("machine", "asked", "expected", "said"),
    [
        (LINUX, [], {LINUX_X86: "linux64"}, ""),
        (LINUX, [WINDOWS], {LINUX_X86: "linux64", WINDOWS: "win64"}, ""),
        (LINUX, BOTH, {LINUX_X86: "linux64", MAC_X86: "darwin64", MAC_ARM: "darwin64"}, ""),
        (LINUX, [LINUX_ARM], {LINUX_ARM: "linux64"}, "not x86_64-linux, this machine's"),
        (LINUX, [LINUX_ARM, LINUX_X86], {LINUX_ARM: "aarch64-linux", LINUX_X86: "linux64"},
         "must be without linux64, or --fmi 3"),
        (ON_ARM, [], {LINUX_ARM: "linux64"}, ""),
        (ON_ARM, [LINUX_X86], {LINUX_X86: "linux64"}, "not aarch64-linux, this"),
        (MAC, BOTH, {MAC_X86: "darwin64", MAC_ARM: "darwin64"}, ""),
    ],
)  # fmt: skip
def test_fmi_2_has_a_folder_for_each_system_and_fmi_3_one_for_each_platform(
    machine, asked, expected, said, monkeypatch
):
    on(machine, monkeypatch)
    places, note = folders(asked, 2)
    assert places == expected
    assert said in note
    assert len(note.splitlines()) == bool(said)
    assert folders(asked, 3) == ({t: t.tuple for t in (this_target(), *asked)}, "")
