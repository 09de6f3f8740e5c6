"""The C header for the bench side: no warning, and it does what the peer in Python does."""

import hmac
import math
import random
import re
import shutil
import struct
import subprocess
from collections import namedtuple
from dataclasses import asdict, fields
from functools import partial
from hashlib import sha256
from pathlib import Path
from select import select

import pytest
from grasp_cosim.fmu_export import link
from grasp_cosim.fmu_export.contract import declared, unpacker
from grasp_cosim.fmu_export.contract import variables as variables_of
from grasp_cosim.fmu_export.link import (
    ALIVE,
    INITIALISE,
    STEP,
    LinkVariable,
    Message,
    Peer,
    PeerCounters,
    Request,
    Sealer,
    Signature,
)
from grasp_cosim.fmu_export.native.bench_header import bench_header, c_prefix
from grasp_cosim.fmu_export.native.c_only import write_c
from grasp_cosim.fmu_export.package import shipped_model
from grasp_cosim.fmu_export.proxy import shared_signature
from grasp_cosim.hil.driven_fmu import MAX_LOST_STEPS
from gripper_plant import rigid
from support import compiled
from support.marks import slow
from support.proxies import HandProxy, RefusedError, UdpAsk

NATIVE = Path(__file__).parent / "native"
STRICT = [
    "-Wall", "-Wextra", "-Werror", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow",
    "-Wundef", "-Wcast-qual", "-Wcast-align",
]  # fmt: skip
C99 = ["gcc", "-std=c99", "-Wstrict-prototypes", *STRICT]
SANITISED = ["-g", "-O2", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]

RANDOM = b"not at random..."
"""What the driver makes its cookies from."""
KEY = b"sixteen bytes of key, and some more"
NAME, BUILD = "bench 1", "0123abcd"
TIMEOUT = 400_000_000
"""ns of the driver's watchdog."""
FAIL, SILENT = 13, 14
"""Values of p.integer with which the driver's model fails, and does not answer."""
NOTHING, SEND, DO_INITIALISE, DO_STEP, ENDED = range(5)
"""Events of the header."""

RECORD = struct.Struct("=dddIIII")

pytestmark = pytest.mark.skipif(not shutil.which("gcc"), reason="NO gcc: nothing to compile with")


def variables(causality, prefix, *kinds):
    return [LinkVariable(f"{prefix}.{kind.lower()}", kind, causality) for kind in kinds]


IN_ORDER = ("Real", "Integer", "Boolean")
EVERY_KIND = Signature(
    (
        *variables("input", "u", *IN_ORDER),
        *variables("parameter", "p", *reversed(IN_ORDER)),
        *variables("output", "y", "Boolean", "Integer", "Real"),
        *variables("output", "q", "Integer", "Real", "Boolean"),
    )
)


def plant():
    """The gripper plant's variables and their start values."""
    listed = variables_of(declared(rigid))
    return shared_signature(listed), {v.name: v.start for v in listed if v.start is not None}


def compile_c(folder, header, name, source, *options):
    """A program from a source, a file or text, that includes the header of that name."""
    (folder / f"{c_prefix(name)}.h").write_text(header, "ascii")
    if isinstance(source, str):
        (folder / "source.c").write_text(source, "ascii")
        source = folder / "source.c"
    return compiled.compile_c([*C99, f"-I{folder}", *options, source, "-lm"], folder / "program")


@pytest.fixture(scope="session")
def driver(made_once):
    """The header for every kind behind a pipe, with all the compiler can check at run time."""

    def fill(folder):
        header = bench_header("EveryKind", EVERY_KIND, peer=NAME)
        compile_c(
            folder, header, "EveryKind", NATIVE / "link_driver.c", *SANITISED,
            f'-DEVERY_KIND_BUILD="{BUILD}"',
        )  # fmt: skip

    return made_once("driver", fill) / "program"


def driven(driver, *words, pipe=b""):
    """What the driver writes."""
    done = subprocess.run([driver, *words], input=pipe, capture_output=True)
    assert (done.returncode, done.stderr) == (0, b"")
    return done.stdout


def sized(data):
    return struct.pack("=I", len(data)) + data


# What the compiler says


@pytest.mark.parametrize("define", [[], ["-DGRIPPER_PLANT_EXAMPLE_MAIN"]])
@pytest.mark.parametrize("optimise", ["-O0", slow("-O3")])
def test_without_a_warning(tmp_path, define, optimise):
    header = bench_header("GripperPlant", *plant())
    source = '#include "gripper_plant.h"\nextern int nothing;\n'
    compile_c(tmp_path, header, "GripperPlant", source, *define, optimise, "-c")


@pytest.mark.skipif(not shutil.which("g++"), reason="NO g++")
def test_in_cpp_and_beside_another(tmp_path):
    (tmp_path / "a.h").write_text(bench_header("GripperPlant", *plant()))
    (tmp_path / "b.h").write_text(bench_header("EveryKind", EVERY_KIND))
    source = tmp_path / "both.cpp"
    source.write_text('#include "a.h"\n#include "b.h"\n#include "a.h"\nint main() { return 0; }\n')
    subprocess.run(["g++", "-std=c++11", *STRICT, "-c", source, "-o", tmp_path / "o"], check=True)


def test_no_more_of_a_library_than_a_target_has():
    library, _, _ = bench_header("GripperPlant", *plant()).partition("#ifdef GRIPPER_PLANT_EXAMPLE")
    included = {line for line in library.splitlines() if line.startswith("#include")}
    assert included == {f"#include <std{n}.h>" for n in ("bool", "def", "int")} | {
        "#include <string.h>"
    }
    assert "malloc" not in library


AWKWARD = (
    "x[1]", "x_1", "x.1", "der(x)", "class", "_", "7", "µ/* */ ", "a\\", "b??/", 'c"%s', "int",
    "int_", "\u202e", "double", "main", "NULL", "x[1].y[2,3]",
)  # fmt: skip


def test_any_name(tmp_path):
    signature = Signature(
        tuple(
            LinkVariable(f"{name}{c[0] * (c == 'output')}", kind, c, "*/ ?")
            for c in ("input", "output")
            for name, kind in zip(AWKWARD, IN_ORDER * 6, strict=True)
        )
    )
    header = bench_header("*/ Ünit", signature)
    prefix = c_prefix("*/ Ünit")
    source = f"""#include "{prefix}.h"
        #include <stdio.h>
        int main(void) {{
            const char *const *line;
            fwrite({prefix}_hash(), 1, 16, stdout);
            for (line = {prefix}_lines(); *line; line++)
                fputs(*line, stdout);
            return 0;
        }}"""
    done = subprocess.run([compile_c(tmp_path, header, "*/ Ünit", source)], capture_output=True)
    assert done.stdout == signature.hash + signature.text.encode()


def test_members_and_functions_by_the_names_of_variables_and_model():
    inputs = [LinkVariable(name, "Real", "input") for name in AWKWARD]
    header = bench_header("M", Signature(tuple(inputs)))
    struct_text = header.partition("typedef struct {")[2].partition("}")[0]
    members = [line.split()[1].rstrip(";") for line in struct_text.strip().splitlines()]
    assert members == [
        "x_1", "x_1_2", "x_1_3", "der_x", "class_", "v", "v_7", "v_2", "a", "b", "c_s", "int_",
        "int_2", "v_3", "double_", "main", "NULL_", "x_1_y_2_3",
    ]  # fmt: skip
    names = ("GripperPlant", "HTTPServer2", "a.b-c", "3D", "模型", "already_snake")
    prefixes = ["gripper_plant", "http_server2", "a_b_c", "model_3_d", "model", "already_snake"]
    assert [*map(c_prefix, names)] == prefixes


def test_start_values():
    starts = {"u.real": 0.1, "u.integer": -(2**31), "u.boolean": True, "p.real": -5e-324}
    starts |= {"p.integer": 2**31 - 1, "y.real": 4.0}
    header = bench_header("EveryKind", EVERY_KIND, starts)
    found = re.findall(r"^    (\S.*?),? +/\* [up]\.\w+ \*/ \\$", header, re.MULTILINE)
    assert found == ["0.1", "(-2147483647 - 1)", "true", "false", "2147483647", "-5e-324"]


@pytest.mark.parametrize(
    ("name", "value", "kind"),
    [
        ("u.real", float("inf"), "Real"), ("p.real", "high", "Real"),
        ("u.integer", 2**31, "Integer"), ("u.integer", 0.5, "Integer"),
        ("p.boolean", 2, "Boolean"),
    ],
)  # fmt: skip
def test_a_start_value_that_is_none(name, value, kind):
    with pytest.raises(ValueError, match=rf"^{name} = .*{kind}") as error:
        bench_header("EveryKind", EVERY_KIND, {name: value})
    assert "\n" not in str(error.value)


# What it computes


@pytest.mark.parametrize(
    ("key", "size"),
    [(16, 0), (63, 55), (64, 56), (65, 64), (131, 152), (64, 65_000)],
)
def test_sha256_and_hmac(driver, key, size):
    drawn = random.Random(size)
    secret, data = drawn.randbytes(key), drawn.randbytes(size)
    expected = sha256(data).digest() + hmac.digest(secret, data, "sha256")
    assert driven(driver, "hmac", pipe=sized(secret) + sized(data)) == expected


Record = namedtuple("Record", "time step behind event safe fresh answer")
"""What the driver did with a datagram."""


def linked(driver, received, key=None):
    """What the driver does with datagrams at times in ns, and what it counts."""
    pipe = b"".join(struct.pack("=q", now) + sized(datagram) for now, datagram in received)
    out = driven(driver, "link", key.decode() if key else "-", pipe=pipe)
    records = []
    for _ in received:
        *found, size = RECORD.unpack_from(out)
        records.append(Record(*found, out[RECORD.size : RECORD.size + size]))
        out = out[RECORD.size + size :]
    return records, struct.unpack(f"={len(fields(PeerCounters)) + 1}Q", out)


def expected(peer, datagram, now, held):
    """What the driver must do, by the peer in Python: event, answer, whether a session begins.

    held are the inputs that it has, which it keeps once it has tripped.
    """
    action = peer.receive(datagram, now)
    if not isinstance(action, Request):
        return (SEND, action, False) if action else (NOTHING, b"", False)
    if action.kind == link.END:
        return ENDED, b"", False
    if not peer.trips or action.fresh:
        held[:] = action.values[:3]
    u, ui, ub = held
    pb, pi, p = action.values[3:]
    outputs = [not ub, ui ^ 0x55, -u, pi ^ 0x55, -p, not pb]
    answer = b"" if pi == SILENT else peer.failed("thirteen") if pi == FAIL else None
    answer = peer.outputs(outputs, action.time + action.step) if answer is None else answer
    return DO_INITIALISE if action.kind == INITIALISE else DO_STEP, answer, action.fresh


REALS = (0.0, -0.0, -1 / 3, 5e-324, 1.7976931348623157e308)
INTEGERS = (0, -1, 2**31 - 1, -(2**31))


def drawn_values(rng):
    reals = [*REALS, *(rng.gauss(0.0, 10.0**k) for k in (-300, 0, 300))]
    integers = (*INTEGERS, rng.randrange(-(2**31), 2**31))
    u, p = rng.choices(reals, k=2)
    return [u, rng.choice(integers), *rng.choices((False, True), k=2), rng.choice(integers), p]


def session(number=99, key=None):
    """A proxy whose datagrams are handed over by the test."""
    proxy = HandProxy(EVERY_KIND, lambda _: None, key)
    proxy.hello(number)
    return proxy


def test_outputs_that_are_none_fail_and_are_named(tmp_path):
    outputs = [LinkVariable(n, "Real", "output", "N") for n in ("y[1]", "µ")]
    source = """#include "m.h"
        #include <stdio.h>
        int main(void) {
            static m_link link;
            static uint8_t answer[M_ANSWER_SIZE];
            m_link_init(&link, (const uint8_t *)"0123456789abcdef", NULL, 0);
            if (m_link_answer(&link, 0.0, answer) || m_link_fail(&link, "x", answer))
                return 1;
            link.pending = link.live = true;
            link.outputs.v = 1e300 * 1e300;
            fwrite(answer, 1, m_link_answer(&link, 0.0, answer), stdout);
            return link.live;
        }"""
    header = bench_header("M", Signature(tuple(outputs)))
    done = subprocess.run([compile_c(tmp_path, header, "M", source)], capture_output=True)
    assert done.returncode == 0
    assert done.stdout[80:].decode() == "output with no valid value: ??"
    assert done.stdout[6:8] == bytes([link.REFUSE, link.FAILED])


# Against the peer in Python


STEPS = (*(0.1, 1e-3, 1e-9, 0.0, -1.0) * 4, link.LONGEST_STEP, 1e300)
"""The last is too long."""
WRONG = [
    *(struct.pack("<d", x) for x in (math.inf, math.nan)), struct.pack("<q", 2**31),
    struct.pack("<Q", 2), bytes(8), b"\xff" * 8,
]  # fmt: skip
"""What is next to the values of a kind, and none; or a size that is none."""


class Proxies:
    """Some proxies at one peer, whose requests come in disorder, again, or damaged."""

    def __init__(self, rng, key):
        self.rng, self.key = rng, key
        self.sessions = [session(i, key) for i in range(4)]
        self.sent = [self.sessions[0].hello(0)]
        self.turn = self.sessions[0]
        self.reached = 0.0

    def request(self):
        """The next datagram."""
        rng = self.rng
        if rng.random() < 0.02:
            self.turn = rng.choice(self.sessions)
        if rng.random() < 0.15:
            return rng.choice(self.sent[-20:])
        self.sent.append(self._drawn(self.turn, rng.random()))
        return self._damaged(self.sent[-1]) if rng.random() < 0.15 else self.sent[-1]

    def _drawn(self, s, chosen):
        rng = self.rng
        if chosen < 0.04 or not s._cookie:
            return self._hello(s)
        if chosen < 0.05 and s._sequence:
            return s.pack(link.END)
        values = drawn_values(rng)
        values[4] = rng.choice((FAIL, SILENT)) if rng.random() < 0.02 else values[4]
        count = rng.choice((0, 0, 0, 1, 5, s._sequence, 2**32 - 1))
        if chosen < 0.2 or not s._sequence:
            return s.request(INITIALISE, rng.choice((0.0, 2.5)), values, counted=count)
        time, step = rng.uniform(-1.0, 1e6), rng.choice(STEPS)
        time = rng.choice((time, self.reached, self.reached + 1e-12))
        self.reached = time + step
        return s.request(STEP, time, values, step, counted=count)

    def _hello(self, s):
        """One of the same interface, for this bench or another, of another, or version."""
        rng = self.rng
        name = rng.choice(("", NAME, NAME, "bench 2"))
        odd = {"body": self._other(name), "interface": bytes(16)}
        odd = odd if rng.random() < 0.2 else {}
        cookie = s._cookie
        version = rng.choice((*[link.VERSION] * 9, 1, 2))
        datagram = s.hello(s._session, name, version=version, **odd)
        s._cookie = cookie
        return datagram

    def _other(self, name):
        """A HELLO's body with a part of another signature, or of any bytes."""
        rng, text = self.rng, EVERY_KIND.text.encode()
        lines = text.splitlines(keepends=True)
        first = rng.randrange(len(lines))
        offset = len(b"".join(lines[:first])) + rng.choice((0, 0, 0, 1, 500))
        size = 1 + rng.randrange(len(text) - len(b"".join(lines[:first])))
        part = bytearray(text[offset : offset + size])
        if part:
            part[rng.randrange(len(part))] ^= rng.choice((0, 0, 2, 96, 128))
        whole = offset + len(part) + rng.choice((0, 0, 9))
        return link.pack_hello(name, link.Part(offset, whole, bytes(part)))

    def _damaged(self, datagram):
        rng = self.rng
        data = bytearray(datagram[: len(datagram) - (link.TAG_SIZE if self.key else 0)])
        kind = rng.randrange(4)
        if kind == 0:
            data[rng.randrange(link.HEAD.size)] ^= 1 << rng.randrange(8)
        elif kind == 1:
            data = data[: rng.randrange(len(data))]
        elif kind == 2:
            data += bytes(rng.randrange(1, 40))
            data[72:76] = struct.pack("<I", len(data) - link.HEAD.size - rng.randrange(2))
        else:
            at = rng.randrange(40, min(len(data), link.HEAD.size + 48), 8)
            data[at : at + 8] = rng.choice(WRONG)
        sealed = self.key if rng.random() < 0.8 else b"another key of another"
        return bytes(data) + (hmac.digest(sealed, data, "sha256") if self.key else b"")

    def hear(self, answer):
        """Takes the cookie of a WELCOME."""
        opened = Sealer(self.key).open(answer)
        if isinstance(opened, Message) and opened.kind == link.WELCOME and opened.session < 4:
            self.sessions[opened.session]._cookie = opened.cookie


@pytest.mark.parametrize("key", [None, KEY], ids=["open", "keyed"])
def test_the_same_as_the_peer_in_python(driver, key):
    """Whatever comes: the same events, the same answers to the bit, the same counts.

    Lost requests are told. The watchdog looks at requests that tell of newer answers: neither one
    that was recorded, sent again and again, nor one whose sender gets no answers keeps it quiet.
    """
    rng = random.Random(20)
    proxies = Proxies(rng, key)
    watched = Watched(Peer(EVERY_KIND, key, RANDOM, NAME, BUILD))
    now = 0
    received, must = [], []
    for _ in range(9000):
        now += rng.choice((1_000_000, 1_000_000, 300_000_000, ALIVE)) if rng.random() < 0.3 else 0
        received.append((now, proxies.request()))
        must.append(watched.receive(received[-1][1], now))
        proxies.hear(must[-1][1])
    records, counters = linked(driver, received, key)
    reached = 0.0
    for i, (record, (event, answer, fresh, safe)) in enumerate(zip(records, must, strict=True)):
        assert (record.event, record.answer, record.safe) == (event, answer, safe), i
        if event in (DO_INITIALISE, DO_STEP):
            behind = record.time - reached if event == DO_STEP else 0.0
            behind = behind if abs(behind) > 1e-9 + 1e-12 * abs(record.time) else 0.0
            assert (record.fresh, record.behind) == (fresh, behind), i
            reached = record.time + record.step
    assert counters == (*asdict(watched.peer.counters).values(), 0)
    seen = asdict(watched.peer.counters)
    assert min(seen[name] for name in seen if key or name != "forged") > 5, seen
    assert {event for event, *_ in must} == {NOTHING, SEND, DO_INITIALISE, DO_STEP, ENDED}
    assert watched.trips > 5


class Watched:
    """The peer in Python with the watchdog of a bench that has its own clock."""

    def __init__(self, peer):
        self.peer = peer
        self.safe = True
        self.trips = 0
        self.held = []

    def receive(self, datagram, now):
        """What expected() says, and whether the safe state is to be written after it."""
        peer = self.peer
        was_live, was_tripped = peer.in_session, peer.trips > 0
        event, answer, fresh = expected(peer, datagram, now, self.held)
        too_long = event == SEND and was_live and not peer.in_session
        if (event == DO_STEP or too_long) and not was_tripped:
            self.safe = False
        silent = now - peer.acknowledged_at > TIMEOUT
        due = not self.safe and (not peer.in_session or peer.trips > 0 or silent)
        if due and peer.in_session:
            peer.trip()
            self.trips += 1
        self.safe = self.safe or due
        return event, answer, fresh, due


# The example, as the target with the gripper plant


@pytest.fixture(scope="session")
def target(made_once):
    def fill(folder):
        header = bench_header("GripperPlant", *plant())
        write_c(folder, shipped_model("GripperPlant"))
        block = [str(folder / f"GripperPlant{part}.c") for part in ("", "_text")]
        compile_c(folder, header, "GripperPlant", NATIVE / "plant_target.c", *SANITISED, *block)

    return made_once("target", fill) / "program"


class Target:
    """A running target, and a proxy's socket to it."""

    def __init__(self, program, *words, key=None):
        self.process = subprocess.Popen(
            [program, "0", *words], bufsize=0, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        line = self.said(self.process.stdout)
        assert line.startswith(b"listening on "), line
        if key is None:  # once, before all else
            assert b"take over a session that is silent for 1 s" in self.said(self.process.stderr)
        self.ask = UdpAsk(("127.0.0.1", int(line.split()[-1])))
        self.signature, self.starts = plant()
        self.proxy = HandProxy(self.signature, self.ask, key)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.ask.__exit__()
        self.process.kill()
        self.process.communicate()

    def said(self, stream):
        """The next line on a stream of the target's; waits for it."""
        assert select([stream], [], [], 10.0)[0]
        return stream.readline()

    def values(self, force=(0.0, 0.0), finger_mass=0.5):
        """What a request carries; the mass is that of finger 1."""
        own = {"force[1]": force[0], "force[2]": force[1], "finger_mass[1]": finger_mass}
        return [(self.starts | own)[v.name] for v in self.signature.request]

    def begin(self, values=None, session=1):
        return self.proxy.begin(session, values or self.values())


def test_the_plant_in_c_to_the_last_bit(target):
    """In free flight, at the impact, pressed and let go again."""
    flat = unpacker(declared(rigid))
    p, u = rigid.Params(), rigid.Inputs()
    x = rigid.initial_state(p, u)
    h, seen = 1e-3, set()
    with Target(target) as bench:
        assert bench.begin() == flat(rigid.outputs(p, x, u))
        for k in range(800):
            force = (-20.0, 15.0 + 0.01 * k) if k < 600 else (3.0, -2.0)
            u = rigid.Inputs(force)
            x = rigid.step(p, x, u, h)
            outputs = bench.proxy.step(k * h, h, bench.values(force))
            expected = flat(rigid.outputs(p, x, u))
            assert list(map(repr, outputs)) == list(map(repr, expected)), k
            assert bench.proxy.outputs_time == k * h + h
            seen.add((expected[8], expected[9]))
    assert seen >= {(False, False), (True, True)}
    assert expected[8:10] == [False, False]


@pytest.mark.parametrize(
    ("time", "mass", "why"),
    [
        (100_001 * 2**-4, 0.5, "more steps were lost than are made up for"),
        (-(2**-4), 0.5, "the time went back"),
        (0.0, -1.0, "finger_mass[1] = -1.0 kg: must be from 0.001 to 1000 kg"),
    ],
)
def test_a_failure_says_why_and_the_next_session_is_served(target, time, mass, why):
    with Target(target) as bench:
        if time:
            bench.begin()
        values = bench.values(finger_mass=mass)
        call = partial(bench.proxy.step, time, 2**-4) if time else partial(bench.proxy.begin, 5)
        with pytest.raises(RefusedError) as refused:
            call(values)
        assert refused.value.args == (link.FAILED, why)
        bench.begin(session=2)
        bench.proxy.step(0.0, 2**-4, bench.values())


def test_a_key_in_a_file(target, tmp_path):
    """Who has another gets no answer: the first that comes is that to the right one."""
    file = tmp_path / "key"
    file.write_bytes(b"\r\n" + KEY + b"\r\n")
    with Target(target, str(file), key=KEY) as bench:
        for key in (b"a" * 16, None):
            bench.ask._socket.send(HandProxy(bench.signature, bench.ask, key).hello(1))
        bench.begin(session=3)


def test_the_safe_state_is_written_first_and_last_and_whenever_the_proxy_is_silent(target):
    """In lockstep, where the next step goes on: what it writes is over then."""
    with Target(target) as bench:
        assert bench.said(bench.process.stderr) == b"safe\n"
        bench.begin()
        for k in range(2):
            bench.proxy.step(0.1 * k, 0.1, bench.values())
            assert bench.said(bench.process.stderr) == b"safe\n"
        assert bench.proxy.trips == 0
        bench.process.terminate()
        assert bench.said(bench.process.stderr) == b"safe\n"
        assert bench.process.wait(30.0) == 0


def test_a_target_with_a_clock_of_its_own(target):
    """It starts with the first step, and answers with what it has."""
    period = 2**-9
    with Target(target, "-", str(period)) as bench:
        bench.begin()
        seen = []
        while not seen or seen[-1][1] == 0.11:
            assert len(seen) < 100_000
            outputs = bench.proxy.step(0.0, 0.1, bench.values((-1.0, 1.0)))
            seen.append((bench.proxy.outputs_time, outputs[0]))
        times, positions = zip(*seen, strict=True)
        assert times[0] == 0.0
        assert times[-1] > 0.0
        assert all((time / period).is_integer() for time in times)
        assert positions[-1] < 0.11


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "usage"), (["65536"], "usage"), (["port"], "usage"), (["0", "-", "-1"], "usage"),
        (["0", "-", "1ms"], "usage"), (["0", "-", "nan"], "usage"),
        (["0", "nowhere"], "nowhere: cannot be read"),
        (["0", "/dev/null"], "/dev/null: cannot be read, or is no key of 16"),
    ],
)  # fmt: skip
def test_a_target_called_wrongly(target, words, said):
    done = subprocess.run([target, *words], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (2, "")
    assert said in done.stderr


def test_the_constants_of_the_protocol_and_descriptions_in_the_comments():
    signature = Signature((LinkVariable("gap", "Real", "input", "m"),))
    header = bench_header("M", signature, descriptions={"gap": "l, to the */ surface"})
    for text in (
        f"M_HEAD_SIZE = {link.HEAD.size},", f"#define M_MOST_LOST {float(MAX_LOST_STEPS)} ",
        f"INT64_C({ALIVE})", "M_LARGEST_REASON = 256 ",
        "double gap;                              /* gap, m: l, to the * / surface */",
    ):  # fmt: skip
        assert text in header
