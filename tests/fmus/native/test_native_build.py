"""Native FMUs as files: what is in them, what it equals, made once, always the same bytes."""

import shutil
import zipfile
from pathlib import Path

import pytest
from grasp_fmus.folder import STAMP
from grasp_fmus.native.build import (
    build_native,
    build_native_block,
    chosen_names,
    planned,
    python_only,
)
from grasp_fmus.native.targets import here
from grasp_fmus.package import HASH, read_members
from support.kinds import TRANSLATED
from support.native_fmus import needs_gcc
from support.slow import slow

ROOT = Path(__file__).parents[3]
SPRING = ROOT / "docs/spring_plant.py"
BINARY = f"binaries/{here().folder}/{{}}{here().suffix}"

pytestmark = needs_gcc


def members(fmu: Path) -> dict[str, bytes]:
    return read_members(fmu.read_bytes())


TWO = ["GraspController", "ProximitySensor"]
"""Names of FMUs that are soon compiled."""


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_all_but_one_can_be_native() -> None:
    assert chosen_names() == TRANSLATED
    assert python_only() == {
        "GripperPlantMuJoCo": "GripperPlantMuJoCo: stays Python only, as it needs mujoco"
    }


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("GripperPlantMuJoCo", "GripperPlantMuJoCo: stays Python only, as it needs mujoco"),
        (
            "gripperplant",
            "gripperplant: no such block; must be of GraspController, GraspControllerAdaptive, ",
        ),
        ("", ": no such block; must be of "),
    ],
)
def test_a_name_that_cannot_be_native(name: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"^") as error:
        build_native(tmp_path / "out", names=["ProximitySensor", name])
    assert str(error.value).startswith(said)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", TRANSLATED)
def test_what_is_in_it(natives: Path, name: str) -> None:
    found = members(natives / f"{name}.fmu")
    others = {n for n in found if not n.startswith(("sources/", "binaries/"))}
    assert others - {"model.png"} == {
        "modelDescription.xml", "documentation/index.html", "documentation/licenses/license.txt",
    }  # fmt: skip
    assert {n for n in found if n.startswith("binaries/")} == {BINARY.format(name)}
    sources = {n.removeprefix("sources/") for n in found if n.startswith("sources/")}
    assert [n for n in sources if not n.endswith(".h")] or sources
    assert {n for n in sources if not n.endswith(".h")} == {f"{name}.c", "buildDescription.xml"}
    assert not [n for n, data in found.items() if HASH.encode() in data or HASH in n]


@pytest.mark.parametrize("name", TRANSLATED)
def test_icon_and_cross_check_files_are_those_of_its_twin(
    natives: Path, fmus: Path, name: str
) -> None:
    ours, theirs = members(natives / f"{name}.fmu"), members(fmus / f"{name}.fmu")
    assert ours.get("model.png") == theirs.get("model.png")
    for end in ("_in.csv", "_ref.csv", "_ref.opt"):
        assert (natives / f"{name}{end}").read_bytes() == (fmus / f"{name}{end}").read_bytes()


@pytest.mark.parametrize("name", TRANSLATED)
def test_its_states_name_the_content_of_its_twin(natives: Path, fmus: Path, name: str) -> None:
    slave = members(fmus / f"{name}.fmu")["resources/slavemodule.txt"]
    content = slave.rpartition(b"_")[2]
    assert b'"%s"' % content in members(natives / f"{name}.fmu")[f"sources/{name}.c"]


def test_nothing_is_made_twice(natives: Path, tmp_path: Path) -> None:
    shutil.copytree(natives, tmp_path / "out")
    built = build_native(tmp_path / "out")
    assert [(b.path.stem, b.status) for b in built] == [(name, "unchanged") for name in TRANSLATED]


@pytest.mark.slow
def test_without_a_stamp_all_is_looked_at(natives: Path, tmp_path: Path) -> None:
    shutil.copytree(natives, tmp_path / "out")
    (tmp_path / "out" / STAMP).unlink()
    assert {b.status for b in build_native(tmp_path / "out")} == {"unchanged"}
    assert contents(tmp_path / "out") == contents(natives)


@pytest.mark.slow
def test_whatever_is_altered_is_made_anew(natives: Path, tmp_path: Path) -> None:
    shutil.copytree(natives, tmp_path / "out")
    fmu = tmp_path / "out/GripperPlant.fmu"
    files = members(fmu)
    with zipfile.ZipFile(fmu, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data + b" " if name.startswith("binaries/") else data)
    found = {b.path.stem: b for b in build_native(tmp_path / "out")}
    assert [name for name, b in found.items() if b.status == "changed"] == ["GripperPlant"]
    assert found["GripperPlant"].changes == (f"{BINARY.format('GripperPlant')}: changed",)
    assert contents(tmp_path / "out") == contents(natives)


def test_one_by_its_name_leaves_the_others_and_the_stamp(natives: Path, tmp_path: Path) -> None:
    (built,) = build_native(tmp_path, names=["ProximitySensor"])
    assert built.status == "new"
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "ProximitySensor.fmu", *(f"ProximitySensor_{e}" for e in ("in.csv", "ref.csv", "ref.opt")),
    ]  # fmt: skip
    assert built.path.read_bytes() == (natives / "ProximitySensor.fmu").read_bytes()


@pytest.mark.slow
def test_the_same_bytes_without_a_cache(
    natives: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for built in build_native(tmp_path / "out", names=TWO):
        assert built.path.read_bytes() == (natives / built.path.name).read_bytes()
    assert len([*(tmp_path / "cache/grasp-cosim/compiled").iterdir()]) == len(TWO)


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("clang"), reason="NO clang")
def test_another_compiler_makes_another_binary_and_nothing_else_anew(
    natives: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(natives, tmp_path / "out")
    monkeypatch.setenv("CC", "clang")
    for built in build_native(tmp_path / "out", names=TWO):
        assert built.changes == (f"{BINARY.format(built.path.stem)}: changed",)


@pytest.mark.parametrize("fmi", [2, slow(3)])
def test_a_block_of_ones_own(fmi: int, tmp_path: Path) -> None:
    plan = planned(fmi=3 if fmi == 3 else 2)
    built = build_native_block(SPRING, tmp_path, plan)
    assert (built.path, built.status) == (tmp_path / "SpringPlant.fmu", "new")
    assert f'fmiVersion="{fmi}.0"' in members(built.path)["modelDescription.xml"].decode()
    assert build_native_block(SPRING, tmp_path, plan).status == "unchanged"


def test_versions_of_fmi_differ_in_what_they_must(natives: Path, tmp_path: Path) -> None:
    (built,) = build_native(tmp_path, planned(fmi=3), ["GripperPlant"])
    two, three = members(natives / "GripperPlant.fmu"), members(built.path)
    assert three["terminalsAndIcons/icon.png"] == two["model.png"]
    assert f"binaries/{here().tuple}/GripperPlant{here().suffix}" in three
    common = {n for n in {*two, *three} if two.get(n) == three.get(n)}
    assert {"sources/block.h", "sources/slave.h", "sources/rigid.h"} <= common
    page = three["documentation/index.html"].decode()
    assert "FMI 3.0 for co-simulation" in page
    assert "fmi3Discard" in page
    assert "fmi2" not in page


def test_a_page_says_that_no_python_is_needed(natives: Path) -> None:
    page = members(natives / "GraspController.fmu")["documentation/index.html"].decode()
    for fact in ("needs no Python", "-ffp-contract=off", "GraspController.c", "1e-12", "Discard"):
        assert fact in page
    assert "$" not in page
    assert "pythonfmu" not in page


def test_the_guid_is_that_of_sources_and_description(
    natives: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever it is compiled with, for, and where."""
    fmu = natives / "GripperPlant.fmu"
    monkeypatch.setenv("CC", "gcc -fno-inline")
    (other,) = build_native(tmp_path, names=["GripperPlant"])
    for name in ("modelDescription.xml", "sources/GripperPlant.c"):
        assert members(other.path)[name] == members(fmu)[name]
    assert members(other.path) != members(fmu)


@pytest.mark.slow
def test_what_changed_is_said_of_the_variables_of_fmi_3_too(tmp_path: Path) -> None:
    text = SPRING.read_text("utf-8")
    own = tmp_path / "spring_plant.py"
    own.write_text(text, "utf-8")
    build_native_block(own, tmp_path, planned((), 3))
    own.write_text(text.replace("high=1e6, tunable", "high=2e6, tunable"), "utf-8")
    changes = build_native_block(own, tmp_path, planned((), 3)).changes
    assert "spring_stiffness: max 1000000.0 -> 2000000.0" in changes
    other_version = build_native_block(own, tmp_path).changes
    assert not any(line.startswith("spring_stiffness") for line in other_version)
