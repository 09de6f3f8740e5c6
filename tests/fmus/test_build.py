"""Building: complete, the same bytes everywhere, made once, and what is there left alone."""

import os
import shutil
import subprocess
import sys
import zipfile
from functools import partial
from pathlib import Path

import pytest
from grasp_cosim.fmu_export import build as builds
from grasp_cosim.fmu_export.build import build, build_block, build_native, planned, sources_key
from grasp_cosim.fmu_export.native.targets import this_target
from grasp_cosim.fmu_export.package import HASH, Built
from grasp_cosim.fmu_export.page import icon
from grasp_cosim.fmu_export.shipped import PACKAGES, SHIPPED, package_folder
from support.fmi2 import read_members
from support.kinds import OWN, TRANSLATED
from support.marks import slow
from support.native_fmus import needs_gcc

ENDS = ("_in.csv", "_ref.csv", "_ref.opt")
BINARY = f"binaries/{this_target().folder}/{{}}{this_target().suffix}"


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.glob("[!.]*")}


def times(folder):
    return {path.name: path.stat().st_mtime_ns for path in folder.glob("[!.]*")}


@pytest.fixture
def out(fmus, tmp_path):
    """A folder with what was built."""
    return Path(shutil.copytree(fmus, tmp_path / "out"))


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    """An empty one."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache/grasp-cosim"


# ------------------------------------------------------------------ what is built


def test_the_fmus_with_their_cross_check_files(fmus, natives):
    checks = [name + end for name in TRANSLATED for end in ENDS]
    for folder in (fmus, natives):
        assert sorted(contents(folder)) == sorted([*(f"{name}.fmu" for name in SHIPPED), *checks])
    assert all((natives / name).read_bytes() == (fmus / name).read_bytes() for name in checks)


@pytest.mark.parametrize("name", SHIPPED)
def test_what_is_in_an_fmu(fmus, natives, name):
    python, native = (read_members(folder / f"{name}.fmu") for folder in (fmus, natives))
    common = {"modelDescription.xml", "documentation/index.html", *["model.png"] * bool(icon(name))}
    binaries = {f"binaries/linux64/{name}.so", f"binaries/win64/{name}.dll"}
    for files, own in ((python, binaries), (native, {BINARY.format(name)})):
        below = ("resources/", "sources/", "documentation/licenses/")
        assert {n for n in files if not n.startswith(below)} == {*common, *own}
        assert "documentation/licenses/license.txt" in files
        assert not [n for n, data in files.items() if HASH in n or HASH.encode() in data]
    content = python["resources/slavemodule.txt"].rpartition(b"_")[2]
    assert b'"%s"' % content in native[f"sources/{name}.c"]
    with zipfile.ZipFile(fmus / f"{name}.fmu") as archive:
        entries = archive.infolist()
    assert [e.filename for e in entries] == sorted(python)
    as_ever = {((1980, 1, 1, 0, 0, 0), 0o644)}
    assert {(e.date_time, e.external_attr >> 16) for e in entries} == as_ever


@pytest.mark.slow
def test_another_process_gives_the_same_bytes(fmus, own_cache, tmp_path):
    """From another folder, with sets in another order, and several at once."""
    script = """if True:
        from pathlib import Path
        from grasp_cosim.fmu_export.build import build
        build(Path("out"))
    """
    command = [sys.executable, "-c", script]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    started = [
        subprocess.Popen(command, cwd=tmp_path, env={**environment, "PYTHONHASHSEED": seed})
        for seed in ("1", "2", "3")
    ]
    assert [process.wait() for process in started] == [0, 0, 0]
    assert contents(tmp_path / "out") == contents(fmus)
    assert len(list((own_cache / "fmus").iterdir())) == 1


@needs_gcc
def test_another_compiler_makes_another_binary_and_nothing_else(natives, tmp_path, monkeypatch):
    """The GUID is that of description and sources, whatever they are compiled with."""
    monkeypatch.setenv("CC", "gcc -fno-inline")
    (built,) = build_native(tmp_path, names=["ProximitySensor"])
    assert {*contents(tmp_path)} == {"ProximitySensor.fmu", *(f"ProximitySensor{e}" for e in ENDS)}
    ours, theirs = read_members(built.path), read_members(natives / "ProximitySensor.fmu")
    assert {n for n in ours if ours[n] != theirs[n]} == {BINARY.format("ProximitySensor")}


# ------------------------------------------------------------------ up to date


def test_what_is_there_is_left_alone(out):
    before = times(out)
    assert build(out) == [Built(out / f"{name}.fmu", "unchanged") for name in SHIPPED]
    assert times(out) == before


@pytest.mark.parametrize(
    ("name", "damage", "status"),
    [
        ("ProximitySensor.fmu", "a bit", "changed"),
        ("ProximitySensor.fmu", "gone", "new"),
        ("GripperPlant_in.csv", "cut", None),
    ],
)
def test_whatever_is_altered_is_mended_and_said(fmus, out, name, damage, status):
    """Also with its size and its time kept; the others are not written, nothing is left beside."""
    file, data = out / name, bytearray((out / name).read_bytes())
    data[len(data) // 2] ^= 1
    before = times(out)
    file.write_bytes(data if damage == "a bit" else data[:1000])
    os.utime(file, ns=(before[name], before[name]))
    if damage == "gone":
        file.unlink()
    found = {b.path.name: b.status for b in build(out) if b.status != "unchanged"}
    assert found == ({name: status} if status else {})
    assert contents(out) == contents(fmus)
    assert {n for n, t in times(out).items() if before[n] != t} == {name}


def test_an_up_to_date_folder_costs_no_import_of_what_builds(fmus, tmp_path):
    script = """if True:
        import sys
        from pathlib import Path
        from grasp_cosim.fmu_export.build import build
        print({built.status for built in build(Path(sys.argv[1]))})
        print([n for n in sys.modules if n.startswith((
            "grasp_cosim.fmu_export.", "pythonfmu", "markdown_it", "latex2mathml", "numpy",
            "importlib.metadata", "gripper_plant", "block_variables",
        ))])
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", script, str(fmus)]
    said = subprocess.check_output(command, cwd=tmp_path, env=environment, text=True)
    needed = ["native", "native.targets", "shipped", "package", "build"]
    assert said == f"{{'unchanged'}}\n{[f'grasp_cosim.fmu_export.{name}' for name in needed]}\n"


SOURCES = (
    "fmu_export/cross_check.py", "fmu_export/icons/GripperPlant.png", "fmu_export/page.html.in",
    "fmu_export/native/c/slave.h", "c_compilers/__init__.py", "si_units.py",
    "gripper_plant/rigid.py", "fmu_export/new.py", "README.md",
    "pythonfmu/resources/binaries/linux64/libpythonfmu-export.so",
    "pythonfmu-9.dist-info",
)  # fmt: skip


def test_every_source_is_in_the_key(tmp_path, monkeypatch):
    """Of copies of the packages, and of the binaries and the version of what is installed."""
    compiled = shutil.ignore_patterns("__pycache__")
    for package in (*PACKAGES, "pythonfmu"):
        shutil.copytree(package_folder(package), tmp_path / package, ignore=compiled)
    for source in builds.SOURCES:
        copy = shutil.copy if source.is_file() else partial(shutil.copytree, ignore=compiled)
        copy(source, tmp_path / source.name)
    monkeypatch.setattr(builds, "SOURCES", [tmp_path / source.name for source in builds.SOURCES])
    shutil.copy(package_folder("gripper_plant").parent / "README.md", tmp_path)
    monkeypatch.setattr(builds, "package_folder", lambda package: tmp_path / package)
    monkeypatch.setattr(builds, "sheet_file", lambda package: tmp_path / "README.md")
    keys = [sources_key()]
    for name in SOURCES:
        with (tmp_path / name).open("ab") as file:
            file.write(b"\n")
        keys.append(sources_key())
    assert len({*keys}) == len(SOURCES) + 1
    assert sources_key() == keys[-1]


def made_once(folder):
    (folder / "made.fmu").write_bytes(b"made")


def test_of_what_is_kept_the_newest_stay(own_cache, monkeypatch):
    monkeypatch.setattr(builds, "MAX_KEPT", 2)
    for k, part in enumerate("abc"):
        os.utime(builds._build_kept(made_once, f"fmus/{part}"), (k, k))
    assert sorted(folder.name for folder in (own_cache / "fmus").iterdir()) == ["b", "c"]


@pytest.mark.usefixtures("own_cache")
def test_a_build_that_fails_leaves_what_was_there(fmus, out, monkeypatch):
    monkeypatch.setattr(
        "grasp_cosim.fmu_export.page.icon", lambda name: (_ for _ in ()).throw(OSError("none"))
    )
    with pytest.raises(OSError, match="none"):
        build(out)
    assert contents(out) == contents(fmus)


# ------------------------------------------------------------------ which blocks


def test_all_are_chosen_where_none_is_named():
    assert builds.chosen_names() == TRANSLATED


@needs_gcc
@pytest.mark.parametrize("fmi", [2, slow(3)])
def test_a_block_of_ones_own(fmi, tmp_path):
    plan = planned(fmi=3 if fmi == 3 else 2)
    built = build_block(OWN["SpringPlant"], tmp_path, plan)
    assert built == Built(tmp_path / "SpringPlant.fmu", "new")
    assert build_block(OWN["SpringPlant"], tmp_path, plan).status == "unchanged"
    found = read_members(built.path)
    assert f'fmiVersion="{fmi}.0"' in found["modelDescription.xml"].decode()
    place = this_target().folder if fmi == 2 else this_target().tuple
    assert f"binaries/{place}/SpringPlant{this_target().suffix}" in found
