"""Packing: reproducible, complete, left alone when nothing changed."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from grasp_fmus.build import build
from grasp_fmus.folder import STAMP, Built, is_current, sources_hash
from grasp_fmus.package import HASH, build_fmu, package_folder, packages
from grasp_fmus.page import icon
from grasp_fmus.shipped import SCRIPTS, blocks
from support.slow import slow

NAMES = list(blocks())
FMUS = [f"{name}.fmu" for name in NAMES]
CHECKED = [name for name in NAMES if name != "GripperPlantMuJoCo"]
"""Those with cross-check files; of the other they would check the package that it needs."""

FILES = sorted(
    [
        STAMP,
        *FMUS,
        *(f"{name}{end}" for name in CHECKED for end in ("_in.csv", "_ref.csv", "_ref.opt")),
    ]
)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def times(folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}


def test_there_is_a_plant_a_sensor_and_a_controller() -> None:
    assert {"GraspController", "GripperPlant", "ProximitySensor"} <= set(NAMES)


def test_builds_the_fmus_with_their_cross_check_files(fmus: Path) -> None:
    assert sorted(path.name for path in fmus.iterdir()) == FILES


@pytest.mark.slow
def test_says_what_it_built(tmp_path: Path) -> None:
    folder = tmp_path / "not" / "there yet"
    assert build(folder) == [Built(folder / name, "new", ()) for name in FMUS]
    assert build(folder) == [Built(folder / name, "unchanged", ()) for name in FMUS]


@pytest.mark.slow
def test_another_process_gives_the_same_bytes(fmus: Path, tmp_path: Path) -> None:
    """From another folder, and with sets in another order."""
    script = "from pathlib import Path; from grasp_fmus import build; build.build(Path('out'))"
    for seed in ("1", "2"):
        subprocess.run(
            [sys.executable, "-c", script],
            cwd=tmp_path, check=True,
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(sys.path)},
        )  # fmt: skip
        assert contents(tmp_path / "out") == contents(fmus)
        shutil.rmtree(tmp_path / "out")


@pytest.mark.parametrize("name", FMUS)
def test_entries_are_sorted_and_dated_alike(fmus: Path, name: str) -> None:
    with zipfile.ZipFile(fmus / name) as archive:
        entries = archive.infolist()
    assert [e.filename for e in entries] == sorted(e.filename for e in entries)
    assert {e.date_time for e in entries} == {(1980, 1, 1, 0, 0, 0)}
    assert {e.external_attr >> 16 for e in entries} == {0o644}
    assert {e.compress_type for e in entries} == {zipfile.ZIP_DEFLATED}


@pytest.mark.parametrize("name", NAMES)
def test_everything_an_fmu_should_have(fmus: Path, name: str) -> None:
    with zipfile.ZipFile(fmus / f"{name}.fmu") as archive:
        found = {n for n in archive.namelist() if not n.startswith("resources/")}
    assert found - {n for n in found if n.startswith("documentation/licenses/")} == {
        "modelDescription.xml",
        *(["model.png"] if icon(name) else []),
        "documentation/index.html",
        f"binaries/linux64/{name}.so",
        f"binaries/win64/{name}.dll",
    }
    assert "documentation/licenses/license.txt" in found


def test_no_place_is_left_where_the_hash_belongs(fmus: Path) -> None:
    for name in FMUS:
        with zipfile.ZipFile(fmus / name) as archive:
            for member in archive.namelist():
                assert HASH not in member
                assert HASH.encode() not in archive.read(member)


def test_an_up_to_date_folder_costs_no_import_of_what_builds(fmus: Path, tmp_path: Path) -> None:
    script = """if True:
        import sys
        from pathlib import Path
        from grasp_fmus.build import build
        print({built.status for built in build(Path(sys.argv[1]))})
        print([n for n in sys.modules if n.startswith((
            "grasp_fmus.", "pythonfmu", "markdown_it", "latex2mathml", "numpy", "zipfile",
            "importlib.metadata", "gripper_plant", "block_variables",
        ))])
    """
    done = subprocess.run(
        [sys.executable, "-c", script, str(fmus)],
        cwd=tmp_path, check=True, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    needed = [f"grasp_fmus.{name}" for name in ("package", "folder", "shipped", "build")]
    assert done.stdout == f"{{'unchanged'}}\n{needed}\n"


@pytest.mark.slow
@pytest.mark.parametrize("data", [None, *map(slow, [b"{", b"", b"[]", b'{"sources": 1}', b"{}"])])
def test_without_a_stamp_that_can_be_read_all_is_looked_at(
    fmus: Path, tmp_path: Path, data: bytes | None
) -> None:
    for path in fmus.iterdir():
        shutil.copy(path, tmp_path)
    (tmp_path / "GripperPlant_ref.opt").write_bytes(b"altered")
    (tmp_path / STAMP).unlink()
    if data is not None:
        (tmp_path / STAMP).write_bytes(data)
    assert {built.status for built in build(tmp_path)} == {"unchanged"}
    assert contents(tmp_path) == contents(fmus)


@pytest.mark.parametrize("name", FILES)
def test_whatever_is_altered_is_found(fmus: Path, tmp_path: Path, name: str) -> None:
    """A bit of a file, with its size and its time kept."""
    for path in fmus.iterdir():
        shutil.copy2(path, tmp_path)
    sources = sources_hash()
    assert is_current(tmp_path, sources)
    file = tmp_path / name
    time, data = file.stat().st_mtime_ns, bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    os.utime(file, ns=(time, time))
    assert not is_current(tmp_path, sources)
    file.unlink()
    assert not is_current(tmp_path, sources)


SOURCES = (
    "grasp_fmus/cross_check.py", "grasp_fmus/scripts/GripperPlant.py",
    "grasp_fmus/icons/GripperPlant.png", "grasp_fmus/page.html.in", "gripper_plant/rigid.py",
    "proximity_sensor/optics.py", "grasp_controller/series.py", "README.md",
    "grasp_fmus/scripts/New.py", "pythonfmu-0.7.0.dist-info/METADATA",
    "pythonfmu/resources/binaries/linux64/libpythonfmu-export.so",
)  # fmt: skip


@pytest.mark.slow
def test_every_source_is_in_the_hash(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of copies of the packages, and of the metadata and binaries of what is installed."""
    for package in packages("grasp_fmus"):
        original = package_folder(package)
        shutil.copytree(original, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(package_folder("gripper_plant").parent / "README.md", tmp_path)
    for found in ("pythonfmu", "pythonfmu-0.7.0.dist-info"):
        shutil.copytree(package_folder("pythonfmu").parent / found, tmp_path / found)
    monkeypatch.syspath_prepend(str(tmp_path))
    with monkeypatch.context() as m:
        for module in [n for n in sys.modules if n.partition(".")[0] in packages("grasp_fmus")]:
            if not module.startswith("grasp_fmus."):
                m.delitem(sys.modules, module)
        before = sources_hash()
        assert sources_hash() == before
        for name in SOURCES:
            with (tmp_path / name).open("ab") as file:
                file.write(b"\n")
            after = sources_hash()
            assert after != before, name
            before = after


@pytest.mark.slow
def test_several_processes_at_once_leave_one_whole_folder(fmus: Path, tmp_path: Path) -> None:
    script = "import sys, pathlib; from grasp_fmus.build import build; build(pathlib.Path('out'))"
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", script]
    builders = [subprocess.Popen(command, cwd=tmp_path, env=env) for _ in range(3)]
    assert [process.wait() for process in builders] == [0, 0, 0]
    assert contents(tmp_path / "out") == contents(fmus)


def test_an_fmu_with_the_same_content_is_left_alone(fmus: Path, tmp_path: Path) -> None:
    for path in fmus.iterdir():
        shutil.copy(path, tmp_path)
    before = times(tmp_path)
    build(tmp_path)
    assert times(tmp_path) == before


@pytest.mark.slow
def test_a_damaged_fmu_is_built_again(fmus: Path, tmp_path: Path) -> None:
    """The others are not, and nothing is left beside them."""
    for path in fmus.iterdir():
        shutil.copy(path, tmp_path)
    (tmp_path / "ProximitySensor.fmu").write_bytes(b"half of an archi")
    before = times(tmp_path)
    statuses = [built.status for built in build(tmp_path)]
    assert statuses == [*(["unchanged"] * (len(FMUS) - 1)), "changed"]
    assert contents(tmp_path) == contents(fmus)
    after = times(tmp_path)
    assert [name for name in FILES if before[name] != after[name]] == ["ProximitySensor.fmu"]


@pytest.mark.slow
def test_cross_check_files_are_written_again_where_they_differ(fmus: Path, tmp_path: Path) -> None:
    for path in fmus.iterdir():
        shutil.copy(path, tmp_path)
    (tmp_path / "GripperPlant_in.csv").unlink()
    (tmp_path / "GraspController_ref.csv").write_text("0\n")
    before = times(tmp_path)
    assert {built.status for built in build(tmp_path)} == {"unchanged"}
    assert contents(tmp_path) == contents(fmus)
    after = times(tmp_path)
    assert {n for n in FILES if before.get(n) != after[n]} == {
        "GripperPlant_in.csv",
        "GraspController_ref.csv",
    }


def test_one_fmu_alone_is_built_without_cross_check_files(fmus: Path, tmp_path: Path) -> None:
    build_fmu(SCRIPTS / "GripperPlant.py", tmp_path)
    assert contents(tmp_path) == {"GripperPlant.fmu": (fmus / "GripperPlant.fmu").read_bytes()}


def test_a_build_that_fails_leaves_what_was_there(
    fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(fmus / "GripperPlant.fmu", tmp_path)
    failure = (_ for _ in ()).throw
    monkeypatch.setattr("grasp_fmus.page.icon", lambda _: failure(OSError("no icon")))
    with pytest.raises(OSError, match="no icon"):
        build(tmp_path)
    assert contents(tmp_path) == {"GripperPlant.fmu": (fmus / "GripperPlant.fmu").read_bytes()}


@pytest.mark.parametrize(
    "name", ["modelDescription.xml", "documentation/index.html", "binaries/linux64/GripperPlant.so"]
)
def test_an_fmu_with_one_damaged_file_is_built_again(fmus: Path, tmp_path: Path, name: str) -> None:
    data = bytearray((fmus / "GripperPlant.fmu").read_bytes())
    with zipfile.ZipFile(fmus / "GripperPlant.fmu") as archive:
        entry = archive.getinfo(name)
    data[entry.header_offset + 30 + len(name) + entry.compress_size // 2] ^= 0xFF
    (tmp_path / "GripperPlant.fmu").write_bytes(data)
    built = build_fmu(SCRIPTS / "GripperPlant.py", tmp_path)
    assert built.status == "changed"
    assert contents(tmp_path) == {"GripperPlant.fmu": (fmus / "GripperPlant.fmu").read_bytes()}
