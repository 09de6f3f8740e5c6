"""XCP: a block is measured and calibrated while it runs, by our master, by pyXCP, and by noise."""

import re
import struct
import subprocess
from contextlib import contextmanager
from functools import cache
from itertools import islice, pairwise
from pathlib import Path

import pytest
from grasp_cosim.fmu_export.contract import build_params, declared
from grasp_cosim.fmu_export.native.a2l import ADDRESS, EPK_ADDRESS
from grasp_cosim.fmu_export.native.c_only import write_c
from grasp_cosim.fmu_export.own_block import own_model
from grasp_cosim.fmu_export.package import shipped_model
from support.compiled import compile_c
from support.kinds import TRANSLATED
from support.marks import slow
from support.native_fmus import needs_gcc
from support.xcp_master import RefusedError, XcpMaster

HERE = Path(__file__).parent
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2", "-ffp-contract=off"]
FORMATS = {"FLOAT64_IEEE": "<d", "SLONG": "<i", "UBYTE": "<?"}

pytestmark = needs_gcc


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The folder with the C of a block, its A2L file and the slave, written once."""

    @cache
    def folder(name):
        folder = tmp_path_factory.mktemp(name)
        write_c(folder, shipped_model(name), a2l=True)
        return folder

    return folder


def compiled(folder, name, main, *options):
    """A program of a block."""
    sources = [folder / file for file in (f"{name}.c", f"{name}_text.c")]
    include = f"-I{folder}"
    out = folder / f"{Path(main).stem}_program"
    return compile_c(["gcc", *STRICT, include, *options, main, *sources, "-lm"], out)


@contextmanager
def slave(folder, name, step="0.001"):
    """A master that is connected to the example's slave."""
    program = compiled(folder, name, folder / "xcp_main.c")
    with subprocess.Popen([program, "0", step], stdout=subprocess.PIPE, text=True) as running:
        try:
            said = running.stdout.readline()
            port = int(re.fullmatch(r"XCP at 127\.0\.0\.1:(\d+), without a key: .*\n", said)[1])
            with XcpMaster(port) as master:
                master.connect()
                yield master
        finally:
            running.terminate()
            assert running.wait(30) == 0


def variables_of(a2l):
    """Address and format of each parameter and of each scalar that is measured, by name."""
    text = a2l.read_text("ascii")
    found = {}
    for name, address, layout in re.findall(
        r'CHARACTERISTIC (\S+) ".*"\n +VALUE (\w+) (\w+) ', text
    ):
        kind = {"Real": "FLOAT64_IEEE", "Integer": "SLONG", "Boolean": "UBYTE"}[layout]
        found[name] = int(address, 16), FORMATS[kind]
    for name, kind, address in re.findall(
        r'MEASUREMENT (\S+) ".*"\n +(\w+) .*\n +ECU_ADDRESS (\w+)\n +SYMBOL', text
    ):
        found[name] = int(address, 16), FORMATS[kind]
    return found


SWITCH = """\
'A switch, whose structs begin with what is small.'

from typing import Annotated, NamedTuple
from dataclasses import dataclass

from block_variables import Input, Output, Parameter, check


@dataclass(frozen=True, slots=True)
class Params:
    enabled: Annotated[bool, Parameter("it switches", tunable=True)] = True

    def __post_init__(self):
        check(self)


class Inputs(NamedTuple):
    on: Annotated[bool, Input("it is on")] = True
    level: Annotated[float, Input("what it switches", unit="V", nominal=1.0)] = 2.5


class State(NamedTuple):
    level: float


class Outputs(NamedTuple):
    is_on: Annotated[bool, Output("it is on", depends_on={"on"})]
    state: Annotated[float, Output("what comes", unit="V", nominal=1.0, depends_on=set())]


def initial_state(p, u):
    return State(u.level)


def step(p, x, u, h):
    return State(x.level + h)


def outputs(p, x, u):
    return Outputs(p.enabled and u.on, x.level)
"""


def test_structs_that_begin_with_what_is_small(tmp_path):
    """The compiler leaves room between them; an output may be called as the state is elsewhere."""
    file = tmp_path / "switch.py"
    file.write_text(SWITCH, "utf-8")
    with own_model(file) as model:
        write_c(tmp_path, model, a2l=True)
    places = variables_of(tmp_path / "Switch.a2l")
    expected = {"enabled": True, "on": True, "level": 2.5, "is_on": True}
    with slave(tmp_path, "Switch") as master:
        for name, value in expected.items():
            address, form = places[name]
            assert struct.unpack(form, master.read(address, struct.calcsize(form))) == (value,)
        address, _ = places["state"]
        [state] = struct.unpack("<d", master.read(address, 8))
        assert 2.5 <= state < 1e3
        master.write(places["enabled"][0], b"\0")
        master.measure([[(places["is_on"][0], 1)]])
        master.wait_for(2)
        assert master.measured[-1][5:] == b"\0"


def outputs_of(block, p, step):
    """All outputs of a block at its start values, at each step."""
    x, u = block.initial_state(p, block.Inputs()), block.Inputs()
    while True:
        y = block.outputs(p, x, u)
        yield [x for value in y for x in (value if isinstance(value, tuple) else (value,))]
        x = block.step(p, x, u, step)


@pytest.mark.parametrize("name", [TRANSLATED[0], *map(slow, TRANSLATED[1:])])
def test_what_the_a2l_file_names_is_at_its_place(name, written):
    """Parameters and inputs at their start values; outputs of one step are those of the block."""
    folder = written(name)
    model = shipped_model(name)
    fields = declared(model.block)
    p = build_params(model.block, fields, [start for f in fields for start in f.starts])
    places, variables = variables_of(folder / f"{name}.a2l"), model.description.variables
    assert [*places] == [v.name for causality in ("parameter", "input", "output")
                         for v in variables if v.causality == causality]  # fmt: skip
    outputs = [places[v.name] for v in variables if v.causality == "output"]
    with slave(folder, name, step="0.01") as master:
        for v in variables:
            address, form = places[v.name]
            [found] = struct.unpack(form, master.read(address, struct.calcsize(form)))
            if v.causality != "output":
                assert repr(found) == repr(v.kind(v.start))
        entries = [(address, struct.calcsize(form)) for address, form in outputs]
        odts = [entries[i : i + 25] for i in range(0, len(entries), 25)]
        master.measure(odts)
        master.wait_for(len(odts))
    octets = master.measured[0][5:] + b"".join(m[1:] for m in master.measured[1 : len(odts)])
    step = struct.unpack_from("<I", master.measured[0], 1)[0] // 10000
    found = struct.unpack("<" + "".join(form[1:] for _, form in outputs), octets)
    expected = next(islice(outputs_of(model.block, p, 0.01), step, None))
    assert [*map(float, found)] == [*map(float, expected)]


def test_the_slave_tells_whose_a2l_file_fits(written):
    folder = written("GraspController")
    text = (folder / "GraspController.a2l").read_text("ascii")
    epk = re.search(rf'EPK "(\w+)" ADDR_EPK {EPK_ADDRESS:#x}', text)[1].encode()
    with slave(folder, "GraspController") as master:
        assert master.read(EPK_ADDRESS, 16) == epk
        for kind, said in ((0, b"GraspController"), (1, b"GraspController"), (5, epk), (4, b"")):
            answer = master(0xFA, kind)
            assert (answer[0], answer[7:]) == (1, said)
            assert struct.unpack_from("<I", answer, 3) == (len(said),)
        event = master(0xD7, 0, 0, 0)
        assert master(0xF5, event[2]) == b"step"


GAIN = ADDRESS + 8 * 4
"""Of simultaneous_contact.gain."""
OUTPUTS = ADDRESS + 8 * (16 + 6)


def test_a_value_is_taken_as_a_parameter_is_or_the_old_one_stays(written):
    real = struct.Struct("<d").pack
    with slave(written("GraspController"), "GraspController") as master:
        for address, data, said in [
            (GAIN, real(-7.5), None),
            (GAIN, real(7.5), None),
            (GAIN, real(1000.5), "out of range"),
            (GAIN, real(float("nan")), "out of range"),
            (GAIN, real(float("inf")), "out of range"),
            (ADDRESS + 8, real(-1.0), "out of range"),  # a mass
            (ADDRESS, b"\0", None),  # a boolean
            (ADDRESS, b"\2", "out of range"),
            (GAIN, real(1.0)[:4], "out of range"),  # half of a number
            (GAIN + 4, real(1.0)[:4], "out of range"),
            (GAIN + 4, real(1.0), "out of range"),
            (GAIN, real(3.0) + b"\1", None),  # two parameters next to one another
            (GAIN, real(4.0) + b"\2", "out of range"),
            (ADDRESS + 1, b"\0", "out of range"),  # no parameter
            (OUTPUTS, real(0.0), "access denied"),
            (OUTPUTS - 8, real(0.0), "access denied"),  # an input
            (OUTPUTS + 8 * 8, real(0.0), "access denied"),  # the state
            (OUTPUTS - 8 * 7, real(0.0) * 2, "out of range"),  # a parameter, and an input
            (OUTPUTS + 8 * 23, real(0.0), "out of range"),  # behind it all
            (EPK_ADDRESS, b"x", "access denied"),
            (0, b"x", "out of range"),
            (0xFFFFFFFF, b"xy", "out of range"),
        ]:
            before = master.read(ADDRESS, 48) + master.read(ADDRESS + 48, 48)
            if said is None:
                master.write(address, data)
                assert master.read(address, len(data)) == data
            else:
                with pytest.raises(RefusedError, match=said):
                    master.write(address, data)
                assert master.read(ADDRESS, 48) + master.read(ADDRESS + 48, 48) == before


def test_what_a_simulation_may_not_change_is_only_read(written):
    """The width of an object is fixed; a finger's mass is not, and must be one."""
    folder = written("GripperPlant")
    places = variables_of(folder / "GripperPlant.a2l")
    text = (folder / "GripperPlant.a2l").read_text("ascii")
    assert re.search(r"CHARACTERISTIC object_width .*\n.* READ_ONLY\n", text)
    real = struct.Struct("<d").pack
    with slave(folder, "GripperPlant") as master:
        for name, value, said in (("object_width", 0.05, "access denied"),
                                  ("finger_mass[1]", -1.0, "out of range")):  # fmt: skip
            address, _ = places[name]
            before = master.read(address, 8)
            with pytest.raises(RefusedError, match=said):
                master.write(address, real(value))
            assert master.read(address, 8) == before
        master.write(places["finger_mass[1]"][0], real(0.25))
        assert master.read(places["finger_mass[1]"][0], 8) == real(0.25)


def test_commands_that_are_wrong(written):
    with slave(written("GraspController"), "GraspController") as master:
        one = [[(OUTPUTS, 8)]]
        for octets, said in [
            ((0xFC,), "synch"),
            ((0xC0,), "unknown"),
            ((0xF5,), "syntax"),
            ((0xF0, 9, 0), "syntax"),
            ((0xF5, 0), "out of range"),
            ((0xF4, 64, 0, 0, 0, 0, 1, 0), "out of range"),  # more than an answer holds
            ((0xF6, 0, 0, 1, 0, 0, 1, 0), "out of range"),  # an extension
            ((0xD7, 0, 1, 0), "out of range"),  # another event
            ((0xE1, 0xFF, 8, 0, 0, 0, 1, 0), "out of range"),  # without a place for it
            ((0xD4, 0, 0, 0, 1), "sequence"),
            ((0xD5, 0, 9, 0), "memory"),
            ((0xD5, 0, 2, 0), None),
            ((0xD5, 0, 2, 0), "sequence"),
            ((0xD3, 0, 0, 0, 0, 1), "sequence"),
            ((0xD4, 0, 2, 0, 1), "out of range"),
            ((0xD4, 0, 0, 0, 17), "memory"),
            ((0xD4, 0, 0, 0, 2), None),
            ((0xD3, 0, 0, 0, 2, 1), "out of range"),
            ((0xD3, 0, 0, 0, 0, 129), "memory"),
            ((0xD3, 0, 0, 0, 0, 2), None),
            ((0xD3, 0, 0, 0, 0, 2), "sequence"),
            ((0xE2, 0, 0, 0, 0, 2), "out of range"),
            ((0xE2, 0, 0, 0, 0, 0), None),
            ((0xE1, 3, 8, 0, 0, 0, 1, 0), "out of range"),  # a bit
            ((0xE1, 0xFF, 255, 0, 0, 0, 1, 0), None),
            ((0xE0, 0x02, 0, 0, 0, 0, 1, 0), "mode"),  # to be stimulated
            ((0xE0, 0x10, 0, 0, 0, 0, 0, 0), "out of range"),
            ((0xDE, 1, 0, 0), "daq config"),  # its mode is not set
            ((0xE0, 0x10, 0, 0, 0, 0, 1, 0), None),
            ((0xDE, 1, 0, 0), "daq config"),  # too much for a message
            ((0xDE, 2, 0, 0), None),
            ((0xDD, 1), "daq config"),
            ((0xDE, 3, 0, 0), "mode"),
            ((0xDE, 1, 5, 0), "out of range"),
            ((0xDD, 3), "mode"),
            ((0xE3, 0, 2, 0), "out of range"),
            ((0xE3, 0, 0, 0), None),
            ((0xDE, 1, 0, 0), None),
            ((0xD6,), "daq active"),
            ((0xDD, 0), None),
            ((0xD6,), None),
        ]:
            if said is None:
                master(*octets)
            else:
                with pytest.raises(RefusedError, match=said):
                    master(*octets)
        master.measure(one)
        assert master(0xFD)[0] == 0x40
        master.connect()  # which stops it
        assert master(0xFD)[0] == 0x00


def test_every_step_is_measured_once_and_to_the_bit(written):
    """Two lists, one of them at each third step, over two messages: the steps of the block."""
    model = shipped_model("GraspController")
    block, fields = model.block, declared(model.block)
    p = build_params(block, fields, [start for f in fields for start in f.starts])
    force, target = OUTPUTS, OUTPUTS + 16
    with slave(written("GraspController"), "GraspController", "0.01") as master:
        master.measure([[(force, 8)], [(target, 8), (GAIN, 8)]], [[(force, 24)]])
        master.wait_for(3 * 60)
        master(0xDD, 0)
        stamps = [struct.unpack_from("<I", m, 1)[0] for m in master.measured if m[0] == 0]
        firsts = [struct.unpack("<d", m[5:]) for m in master.measured if m[0] == 0]
        seconds = [struct.unpack("<dd", m[1:]) for m in master.measured if m[0] == 1]
        thirds = [struct.unpack("<ddd", m[5:]) for m in master.measured if m[0] == 2]
    assert master.missing == 0
    assert {b - a for a, b in pairwise(stamps)} == {10000}
    steps = islice(outputs_of(block, p, 0.01), stamps[-1] // 10000 + 1)
    rows = [tuple(y[:3]) for y in steps]
    expected = [rows[stamp // 10000] for stamp in stamps]
    assert firsts == [row[:1] for row in expected]
    assert seconds == [(row[2], 3.0) for row in expected]
    assert thirds == expected
    assert expected[0] != expected[-1]


def test_a_prescaler_passes_steps_over(written):
    with slave(written("GraspController"), "GraspController", "0.002") as master:
        master.measure([[(OUTPUTS, 8)]], prescaler=3)
        master.wait_for(20)
    stamps = [struct.unpack_from("<I", m, 1)[0] for m in master.measured]
    assert {b - a for a, b in pairwise(stamps)} == {6000}


@pytest.mark.parametrize("name", ["GraspController", slow("TandemPlant")])
def test_noise_under_the_sanitizers(name, written):
    """Random commands, short, long and torn: the slave still answers, its parameters are valid."""
    folder = written(name)
    sanitized = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    driver = folder / "driver.c"
    driver.write_text(re.sub(r"\bMODEL_", f"{name.upper()}_", re.sub(
        r"\bModel_", f"{name}_", (HERE / "xcp_driver.c").read_text("utf-8")
    )).replace("Model.h", f"{name}_xcp.h"), "utf-8")  # fmt: skip
    program = compiled(folder, name, driver, *sanitized)
    said = subprocess.check_output([program, "100000"], text=True)
    answered, refused, changed, measured = map(int, said.split())
    assert answered > 50000
    assert refused > 1000
    assert changed > 50
    assert measured > 1000


def test_pyxcp_reads_all_and_calibrates(written):
    """A master of others: all parameters, one that is set, one that is refused and stays."""
    pytest.importorskip("pyxcp")
    from pyxcp.config import create_application_from_config
    from pyxcp.master.master import Master
    from pyxcp.types import XcpResponseError

    folder = written("GraspController")
    places = variables_of(folder / "GraspController.a2l")
    starts = {v.name: v.start for v in shipped_model("GraspController").description.variables}
    with slave(folder, "GraspController") as ours:
        port = ours.socket.getpeername()[1]
        transport = {"host": "127.0.0.1", "port": port, "protocol": "UDP"}
        config = {
            "Transport": {"layer": "ETH", "Eth": transport},
            "General": {"disable_error_handling": True},
        }
        with Master("eth", create_application_from_config(config)) as master:

            def read(name):
                address, form = places[name]
                master.setMta(address)
                return struct.unpack(form, master.fetch(struct.calcsize(form)))[0]

            master.connect()
            assert master.identifier(1) == "GraspController"
            for name in places:
                if starts[name] is not None:
                    assert read(name) == starts[name]
            gain, mass = "simultaneous_contact.gain", "simultaneous_contact.mass"
            master.setMta(places[gain][0])
            master.download(struct.pack("<d", 6.5))
            assert read(gain) == 6.5
            master.setMta(places[mass][0])
            with pytest.raises(XcpResponseError, match="ERR_OUT_OF_RANGE"):
                master.download(struct.pack("<d", -1.0))
            assert read(mass) == starts[mass]
            master.disconnect()
        ours.connect()
        assert ours.read(GAIN, 8) == struct.pack("<d", 6.5)
