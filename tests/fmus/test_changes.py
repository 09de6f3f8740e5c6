"""What a build says of the FMU that was there before: as an engineer edits the sensor."""

import io
import shutil
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from grasp_fmus.contract import declared
from grasp_fmus.fmu import build_fmu
from grasp_fmus.folder import Built
from grasp_fmus.shipped import SCRIPTS
from proximity_sensor import channel

SENSOR = Path(__file__).parents[2] / "sensor"
SCRIPT = SCRIPTS / "ProximitySensor.py"
OPTICS, CARD = "proximity_sensor/optics.py", "README.md"
CLOCK = "proximity_sensor/clock.py"
"""Of the parameters the last."""

GAIN = "low=0.0, high=1e6, tunable=True\n        ),\n    ] = 0.0024"
EXPONENT = '"n, diffusion exponent", unit="1", low=0.1, high=10.0, tunable=True)'
OUTPUT = (
    "    intensity: Annotated[\n        float, "
    'Output("xi, offset-compensated output", unit="V", nominal=0.1, depends_on={"gap"})\n    ]\n'
)
FORMULA = "p.gain * p.alpha / (l + p.offset_distance) ** p.diffusion_exponent"
RATE = "high=1e6)\n    ] = 10_000.0\n"

DESCRIPTION, SOURCE = "modelDescription.xml: changed", f"resources/{OPTICS}: changed"

Edit = tuple[str, str, str]
"""A file of the sensor, a text that stands there once, and what to put in its place.

An empty text is that of a file which is not there yet.
"""

LENS: tuple[Edit, Edit] = (
    ("proximity_sensor/lens.py", "", '"""A lens."""\n'),
    (OPTICS, "from dataclasses", "from . import lens\nfrom dataclasses"),
)

Build = Callable[..., Built]


@pytest.fixture
def build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Build:
    """Builds the FMU of the sensor, always into the same folder, with edits of its sources."""
    copies: list[Path] = []

    def with_edits(*edits: Edit) -> Built:
        copy = tmp_path / f"sensor {len(copies)}"
        copies.append(copy)
        shutil.copytree(SENSOR, copy, ignore=shutil.ignore_patterns("__pycache__"))
        for file, before, after in edits:
            text = (copy / file).read_text("utf-8") if before else ""
            assert text.count(before) == 1
            (copy / file).write_text(text.replace(before, after), "utf-8")
        with monkeypatch.context() as patch:
            for name in [m for m in sys.modules if m.partition(".")[0] == "proximity_sensor"]:
                patch.delitem(sys.modules, name)
            patch.syspath_prepend(copy)
            built = build_fmu(SCRIPT, tmp_path / "out")
            for name in [m for m in sys.modules if m.partition(".")[0] == "proximity_sensor"]:
                del sys.modules[name]
        return built

    return with_edits


def test_new(build: Build, tmp_path: Path) -> None:
    built = build()
    assert built == Built(tmp_path / "out" / "ProximitySensor.fmu", "new", ())
    assert zipfile.is_zipfile(built.path)


def test_unchanged_is_left_alone(build: Build) -> None:
    path = build().path
    before = path.stat().st_mtime_ns, path.stat().st_ino, path.read_bytes()
    assert build() == Built(path, "unchanged", ())
    assert (path.stat().st_mtime_ns, path.stat().st_ino, path.read_bytes()) == before


def test_a_change_is_reported_once(build: Build) -> None:
    edit = (OPTICS, FORMULA, f"2.0 * {FORMULA}")
    assert [build().status, build(edit).status, build(edit).status] == [
        "new",
        "changed",
        "unchanged",
    ]
    assert build().status == "changed"


@pytest.mark.parametrize(
    ("edits", "lines"),
    [
        pytest.param([(OPTICS, FORMULA, f"2.0 * {FORMULA}")], [SOURCE], id="code"),
        pytest.param(
            [(CARD, "# ", "# The ")], ["documentation/index.html: changed"], id="card"
        ),
        pytest.param(
            [*LENS],
            ["resources/proximity_sensor/lens.py: added", SOURCE],
            id="file",
        ),
        pytest.param(
            [(OPTICS, GAIN, GAIN.replace("0.0024", "0.0025"))],
            ["gain: nominal 0.0024 -> 0.0025", "gain: start 0.0024 -> 0.0025", DESCRIPTION, SOURCE],
            id="start",
        ),
        pytest.param(
            [(OPTICS, GAIN, GAIN.replace("low=0.0, high=1e6", "low=1e-9, high=5.0"))],
            ["gain: max 1000000.0 -> 5.0", "gain: min 0.0 -> 1e-09", DESCRIPTION, SOURCE],
            id="range",
        ),
        pytest.param(
            [(CLOCK, RATE, RATE.replace("1e6", "1e6, tunable=True"))],
            [
                "sampling.rate: variability fixed -> tunable",
                DESCRIPTION,
                f"resources/{CLOCK}: changed",
            ],
            id="variability",
        ),
        pytest.param(
            [(OPTICS, OUTPUT, OUTPUT.replace('"V"', '"1"'))],
            [
                "intensity: displayUnit mV -> none",
                "intensity: unit V -> 1",
                DESCRIPTION,
                SOURCE,
            ],
            id="unit",
        ),
        pytest.param(
            [(OPTICS, EXPONENT, EXPONENT.replace(", diffusion", " in Eq. (9), diffusion"))],
            [
                "diffusion_exponent: description n, diffusion exponent -> "
                "n in Eq. (9), diffusion exponent",
                DESCRIPTION,
                SOURCE,
            ],
            id="description",
        ),
        pytest.param(
            [(OPTICS, OUTPUT, OUTPUT.replace('{"gap"}', "set()"))],
            [DESCRIPTION, SOURCE],
            id="dependency",
        ),
        pytest.param(
            [
                (CLOCK, RATE,
                 f"{RATE}    jitter: Annotated[float, "
                 'Parameter("jitter", unit="s", low=0.0, high=1.0)] = 0.0\n'),
            ],
            [
                "sampling.jitter: added",
                "surface: valueReference 26 -> 27",
                DESCRIPTION,
                f"resources/{CLOCK}: changed",
            ],
            id="variable added",
        ),
        pytest.param(
            [(OPTICS, OUTPUT, OUTPUT.replace("intensity", "brightness"))],
            ["brightness: added", "intensity: removed", DESCRIPTION, SOURCE],
            id="variable renamed",
        ),
    ],
)  # fmt: skip
def test_what_changed_and_nothing_else(build: Build, edits: list[Edit], lines: list[str]) -> None:
    path = build().path
    assert build(*edits) == Built(path, "changed", tuple(lines))


def test_a_file_that_nothing_imports_changes_nothing(build: Build) -> None:
    path = build().path
    assert build(LENS[0]) == Built(path, "unchanged", ())


def test_variables_that_follow_move_up(build: Build) -> None:
    """The value reference is part of the interface: a host may have it written down."""
    text = '    """Inputs: the surface before the sensor."""\n'
    added = f'{text}\n    tilt: Annotated[float, Input("tilt", unit="1", nominal=0.1)] = 0.0\n'
    build()
    lines = build((OPTICS, text, added)).changes
    names = [name for f in declared(channel) for name in f.names]
    moved = [f"{name}: valueReference {k} -> {k + 1}" for k, name in enumerate(names)]
    assert "gain: valueReference 3 -> 4" in moved
    assert lines == (*sorted([*moved, "tilt: added"]), DESCRIPTION, SOURCE)
    assert build().changes[-3:] == ("tilt: removed", DESCRIPTION, SOURCE)


def test_a_file_removed(build: Build) -> None:
    build(*LENS)
    assert build().changes == ("resources/proximity_sensor/lens.py: removed", SOURCE)


def archive(*members: tuple[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file:
        for name, data in members:
            file.writestr(name, data)
    return buffer.getvalue()


def with_bits_flipped(fmu: bytes, member: str) -> bytes:
    """The FMU with the first byte of one compressed member inverted."""
    with zipfile.ZipFile(io.BytesIO(fmu)) as file:
        start = file.getinfo(member).header_offset + 30 + len(member)
    return fmu[:start] + bytes([fmu[start] ^ 0xFF]) + fmu[start + 1 :]


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda fmu: b"",
    "text": lambda fmu: b"half of an archi",
    "cut": lambda fmu: fmu[: len(fmu) // 2],
    "archive of something else": lambda fmu: archive(("readme.txt", b"nothing")),
    "no description": lambda fmu: archive(("resources/slavemodule.txt", b"ProximitySensor_0")),
    "no XML": lambda fmu: archive(("modelDescription.xml", b"<fmiModelDesc")),
    "name damaged": lambda fmu: with_bits_flipped(fmu, "resources/slavemodule.txt"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_was_there_is_no_fmu(build: Build, damage: str) -> None:
    path = build().path
    sound = path.read_bytes()
    path.write_bytes(DAMAGES[damage](sound))
    assert build() == Built(path, "changed", ("what was there is no FMU",))
    assert path.read_bytes() == sound


def test_a_damaged_description_does_not_hide_a_change(build: Build) -> None:
    path = build().path
    path.write_bytes(with_bits_flipped(path.read_bytes(), "modelDescription.xml"))
    built = build((OPTICS, FORMULA, f"2.0 * {FORMULA}"))
    assert built == Built(path, "changed", ("what was there is no FMU",))
