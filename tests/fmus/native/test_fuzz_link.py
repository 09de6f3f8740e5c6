"""libFuzzer on the C of both sides of the link, with sanitisers, from inputs that make sense."""

import os
import shutil
import struct
import subprocess
from pathlib import Path

import pytest
from grasp_cosim.fmu_export.link import (
    HELLO,
    INITIALISE,
    STEP,
    VERSION,
    LinkVariable,
    Signature,
    pack_hello,
)
from grasp_cosim.fmu_export.native.bench_header import bench_header
from support import marks
from support.native_proxies import write_sources

FUZZ = Path(__file__).parent / "fuzz"
RUNS = marks.part(60_000)
"""Inputs that each side is given."""

FLAGS = [
    "-std=c99",
    "-g",
    "-O1",
    "-fsanitize=fuzzer,address,undefined",
    "-fno-sanitize-recover=all",
]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.campaign,
    pytest.mark.skipif(not shutil.which("clang"), reason="NO clang"),
]

KINDS = ("Real", "Integer", "Boolean")
CAUSALITIES = (
    ("input", "u"),
    ("parameter", "p"),
    ("output", "y"),
)
EVERY_KIND = Signature(
    tuple(LinkVariable(f"{n}.{k.lower()}", k, c) for c, n in CAUSALITIES for k in KINDS)
)


def fuzzer(folder, source):
    program = folder / source.stem
    files = ["-I", str(folder), str(source), "-o", str(program)]
    command = ["clang", *FLAGS, *files, "-lm"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    return program


def fuzzed(program, seeds):
    """Nothing is found, and no more memory needed, in so many runs."""
    corpus, found = program.parent / "corpus", program.parent / "found"
    for folder in (corpus, found):
        folder.mkdir()
    for i, seed in enumerate(seeds):
        (corpus / f"{i}").write_bytes(seed)
    options = [f"-runs={RUNS}", f"-seed={marks.first_seed + 1}", "-rss_limit_mb=600"]
    options += ["-max_len=6000", f"-artifact_prefix={found}/", "-print_final_stats=1"]
    options += ["-report_slow_units=1000"]  # s: how slow one is depends on the machine
    # By a shell: a process inherits the peak of memory of the one that starts it, here of tests.
    command = ["/bin/sh", "-c", '"$@"; exit $?', "sh", str(program), *options, str(corpus)]
    # What was freed is kept to find its use, and counts as memory: how much depends on speed.
    environment = os.environ | {"ASAN_OPTIONS": "quarantine_size_mb=16"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr[-3000:]
    assert not [*found.iterdir()]
    runs = next(line for line in done.stderr.splitlines() if "number_of_executed_units" in line)
    assert int(runs.split()[-1]) >= RUNS


def sized(data):
    return struct.pack("<H", len(data)) + data


def test_a_proxy_whatever_its_peer_sends(tmp_path):
    write_sources(tmp_path)

    def seeds():
        """Sessions that begin, and go on with answers, refusals, silence and other things."""
        welcome, outputs, silence = b"\x48\0\0\0", b"\x0a\0\0\0", b"\x10"
        for settings in (*range(32), *range(96, 128)):
            begun = bytes([settings]) + welcome + outputs
            yield begun + outputs * 12
            yield begun + outputs * 2 + silence * 40
            for code in range(1, 7):
                refusal = bytes([code << 3 | 4]) + sized(b"the proxy has\none \xff") + b"\0"
                yield bytes([settings]) + refusal
                yield begun + refusal + (welcome + outputs) * 4
            yield bytes([settings]) + (b"\x03" + sized(bytes(90))) * 4

    fuzzed(fuzzer(tmp_path, FUZZ / "proxy.c"), seeds())


def test_a_peer_whatever_proxies_send(tmp_path):
    (tmp_path / "every_kind.h").write_text(bench_header("EveryKind", EVERY_KIND), "ascii")

    def datagram(kind, body, step=0.0):
        head = struct.pack("<4sHBB16sQQQddqII", b"GRSP", VERSION, kind, 0, EVERY_KIND.hash, 7, 0,
                           int(kind != HELLO), 0.0, step, 0, len(body), 0)  # fmt: skip
        return head + body

    def seeds():
        values = bytes(2 * 3 * 8)
        for settings in (0, 1):
            tag = bytes(32 * settings)
            hello = b"\x0b" + sized(datagram(HELLO, pack_hello("", *EVERY_KIND.parts())) + tag)
            begin = b"\x03" + sized(datagram(INITIALISE, values) + tag)
            step = b"\x27" + sized(datagram(STEP, values, 0.1) + tag)
            yield bytes([settings]) + hello + begin + step * 5
            yield bytes([settings]) + hello + begin + step + b"\x83" + hello[1:] + begin + step

    fuzzed(fuzzer(tmp_path, FUZZ / "peer.c"), seeds())
