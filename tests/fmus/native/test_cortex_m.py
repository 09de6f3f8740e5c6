"""The controllers' C on a Cortex-M4F and M7, in qemu: Python's outputs, without a heap."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from grasp_cosim import cli
from support.compiled import compile_c
from support.direct import closed_loop
from support.pages import BLOCKS, commands_of

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/how_to/microcontroller.md").read_text("utf-8")
CONSOLES = [block for kind, block in BLOCKS.findall(PAGE) if kind == "console"]
SHOWN = [shown for block in CONSOLES for shown in commands_of(block)]
COMMANDS = [command for command, _ in SHOWN]
(COMPILE,) = (c for c in COMMANDS if c.startswith("arm-none-eabi-gcc"))
LINKED = f"{COMPILE} -DWITH_LINK"
"""The same with a session of the link."""
CALIBRATED = f"{COMPILE} -g -DWITH_XCP"
"""The same with a session of XCP."""
LOAD = PAGE.partition("## Measured load\n")[2].partition("\n## ")[0]
TABLE = [line.split(" | ") for line in re.findall(r"^\|(.*) \|$", LOAD, re.MULTILINE)]
ADAPTIVE = {
    "GraspController": "GraspControllerAdaptive",
    "grasp_controller": "grasp_controller_adaptive",
    "GRASP_CONTROLLER": "GRASP_CONTROLLER_ADAPTIVE",
    "GRASPCONTROLLER": "GRASPCONTROLLERADAPTIVE",
    "published": "adaptive",
    "23-32": "23-37",
    "docs/cortex_m.c": "cortex_m.c",
}
M7 = {"cortex-m4": "cortex-m7", "fpv4-sp-d16": "fpv5-d16", "mps2-an386": "mps2-an500"}
"""What the page has replaced for the other controller, and for the other core."""

TICK = 5
"""Instructions in a tick of the timer, as the page says."""

TOOLS = ("arm-none-eabi-gcc", "qemu-system-arm")

pytestmark = [pytest.mark.skipif(shutil.which(tool) is None, reason=f"NO {tool}") for tool in TOOLS]


def replaced(text, words):
    for old, new in words.items():
        text = text.replace(old, new)
    return text


def run(command):
    """What a command of the page says."""
    if command.startswith("grasp-cosim "):
        assert cli.main(shlex.split(command)[1:]) == 0
        return ""
    done = subprocess.run(
        command, shell=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


def said(image):
    return {what: int(number) for what, number in re.findall(r"^(.+): (\d+)$", image, re.MULTILINE)}


@pytest.mark.slow
@pytest.mark.parametrize("controller", ["published", "adaptive"])
def test_the_figures_of_the_page(checkout, controller):
    words = ADAPTIVE if controller == "adaptive" else {}
    source = (ROOT / "docs/cortex_m.c").read_text("utf-8")
    (checkout / "cortex_m.c").write_text(replaced(source, words), "utf-8")
    *before, compiled, size, emulated = [replaced(command, words) for command in COMMANDS]
    linked, calibrated = replaced(LINKED, words), replaced(CALIBRATED, words)
    for command in before:
        run(command)
    for core, other in ("M4F", {}), ("M7", M7):
        assert run(replaced(compiled, other)) == ""
        symbols = run("arm-none-eabi-nm controller.elf").split()
        assert {"exp", "main"} <= {*symbols}
        assert not [name for name in symbols if re.search("alloc|sbrk|free", name)]
        bytes_of = dict(re.findall(r"^(\.\w+) +(\d+)", run(size), re.MULTILINE))
        image = said(run(replaced(emulated, other)))
        if (controller, core) == ("published", "M4F"):
            assert [*said(SHOWN[-1][1])] == [*image]
            assert said(SHOWN[-1][1]) == pytest.approx(image, rel=0.1)
        assert image["steps"] == 3001
        assert image["steps begun late"] == 0
        difference = image["largest difference, 1e-18"] * 1e-18
        assert difference < 1e-12
        assert run(replaced(linked, other)) == ""
        image |= said(run(replaced(emulated, other)))
        assert run(replaced(calibrated, other)) == ""
        image |= said(run(replaced(emulated, other)))
        assert image["bytes that it sends"] == 4 + 1 + 4 + 6 * 8
        assert image["bytes of memory for XCP"] < 3000
        assert image["bytes of its answer"] > 80 + 32
        column = TABLE[0].index(f"Cortex-{core}, {controller}")
        page = [float(row[column].replace(",", "")) for row in TABLE[1:]]
        found = [
            image["ticks of the clock a step"] * TICK,
            image["ticks of the longest"] * TICK,
            image["ticks of a refusal"] * TICK,
            image["ticks of a keyed STEP"] * TICK,
            image["ticks of a DAQ event"] * TICK,
            image["bytes of memory for XCP"],
            image["bytes of stack with it"],
            int(bytes_of[".data"]) + int(bytes_of[".bss"]),
            int(bytes_of[".text"]),
        ]
        assert found == pytest.approx(page[:-1], rel=0.1)
        assert difference == pytest.approx(page[-1], rel=0.1, abs=1e-18)


def test_a2ltool_finds_the_memory_in_the_image(rows):
    """And puts the addresses of its members in the place of those on a host."""
    a2ltool = Path(sys.executable).with_name("a2ltool")
    if not a2ltool.exists():
        pytest.skip("NO a2ltool")
    said_of(rows)  # which writes the record
    run(CALIBRATED)
    before = Path("controller_c/GraspController.a2l").read_text("ascii")
    options = "--elffile controller.elf --update ADDRESSES --strict -o target.a2l"
    run(f"{a2ltool} controller_c/GraspController.a2l {options}")
    symbols = run("arm-none-eabi-nm controller.elf")
    [memory] = re.findall(r"^(\w+) \w GraspController_memory$", symbols, re.MULTILINE)
    place = r"(?:VALUE|ECU_ADDRESS) (0x\w+)"
    old, new = (
        [int(at, 16) for at in re.findall(place, text)]
        for text in (before, Path("target.a2l").read_text("ascii"))
    )
    assert len(old) == len(new) > 30
    assert {b - a for a, b in zip(old, new, strict=True)} == {int(memory, 16) - old[0]}


@pytest.fixture
def rows(tmp_path, monkeypatch):
    """A short record, as `cut` makes it; the current folder has the C of the controller."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    run(COMMANDS[0])
    signals = closed_loop({}, 1e-3, 50)
    columns = [*signals.values()]
    return [
        [*map(repr, map(float, row))] for row in zip(*columns[1:5], *columns[22:32], strict=True)
    ]


def said_of(rows):
    """What the M7's image says of a record; the controller in it is compiled once."""
    Path("controller_c/recorded.h").write_text("".join(f"{','.join(row)},\n" for row in rows))
    command, emulator = (replaced(command, M7) for command in (COMPILE, COMMANDS[-1]))
    compiler, controller = shlex.split(command), "controller_c/GraspController.c"
    options = [word for word in compiler if word.startswith(("-m", "-std", "-O", "-f"))]
    compile_c([compiler[0], *options, "-c", controller], Path("controller.o"))
    return run(f"{command.replace(controller, 'controller.o')} && {emulator} || echo failed")


def test_an_image_finds_a_difference_and_steps_that_take_too_long(rows):
    rows[-1][-1] = repr(float(rows[-1][-1]) + 1e-9)
    found = said(said_of(rows))
    assert found["steps"] == len(rows) == 51
    assert found["largest difference, 1e-18"] == pytest.approx(1e9, rel=1e-3)
    assert found["steps begun late"] == 0
    slower = said(run(replaced(COMMANDS[-1], {**M7, "shift=3": "shift=10"})))
    assert slower["steps begun late"] > 40


def test_an_image_ends_where_an_input_is_none(rows):
    rows[-1][0] = "NAN"
    assert said_of(rows).splitlines() == ["a step is refused: number 0", "failed"]
