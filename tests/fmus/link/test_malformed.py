"""Malformed datagrams at each side, in Python and in C: no effect, each counted once.

A million of them, in the slow tests a tenth of that.
"""

import gc
import hmac
import shutil
import struct
import subprocess
import sys
from math import inf, nan
from pathlib import Path
from random import Random
from typing import Literal

import pytest
from grasp_fmus.link.message import (
    HEAD,
    INITIALISE,
    LARGEST,
    OUTPUTS,
    VERSION,
    Codec,
    Sealer,
)
from grasp_fmus.link.peer import Peer, Request
from grasp_fmus.native.bench_header import bench_header
from support import campaign
from support.native_proxies import write_sources
from support.proxies import HandProxy
from support.scripted_peer import SIGNATURE, answers

SOURCE = Path(__file__).parents[1] / "native/malformed.c"
MANY = campaign.part(1_000_000)
KEY = b"sixteen bytes of key, and some more"
VALUES = [1.5, 3, True, 2.0, 0.5]
SESSION, COOKIE = 99, 5

Side = Literal["client", "peer"]

pytestmark = [pytest.mark.slow, pytest.mark.campaign]


def malformed(side, signature, key):
    """Of any size and with any fault, most of them under the right key."""
    random = Random(campaign.first_seed)
    codec = Codec(signature.answer if side == "client" else signature.request)
    kind = OUTPUTS if side == "client" else INITIALISE
    good = bytes(codec.size)

    def sealed(data):
        return data + (hmac.digest(key, data, "sha256") if key else b"")

    def made(body=good, **changed):
        fields = {
            "magic": b"GRSP", "version": VERSION, "kind": kind, "code": 0,
            "interface": signature.hash, "session": SESSION, "cookie": COOKIE, "sequence": 1,
            "time": 0.0, "step": 0.0, "sent": 0, "size": len(body), "zero": 0,
        } | changed  # fmt: skip
        return sealed(HEAD.pack(*fields.values()) + body)

    found = [
        b"", b"x", bytes(79), bytes(80), bytes(LARGEST), bytes(LARGEST + 1), made()[:-1],
        made() + b"\0", made(magic=b"GRSQ"), made(kind=0),
        made(kind=8), made(kind=255), made(size=len(good) + 1), made(size=2**32 - 1), made(zero=1),
        made(time=nan), made(time=inf), made(step=-inf), made(time=1e308, step=1e308),
    ]  # fmt: skip
    found += [random.randbytes(random.randrange(300)) for _ in range(100)]
    found += [b"GRSP\2\0" + random.randbytes(random.randrange(300)) for _ in range(100)]
    if key:
        found += [made()[:-32], made()[:-1] + bytes([made()[-1] ^ 1]), made()[:-32] + bytes(32)]
    return [d for d in found if Sealer(key).open(d) in ("malformed", "forged")]


def check_growth(step):
    """No more objects in the end than after a tenth."""
    for i in range(MANY // 10):
        step(i)
    gc.collect()
    before = sys.getallocatedblocks()
    for i in range(MANY // 10, MANY):
        step(i)
    gc.collect()
    assert sys.getallocatedblocks() - before < 2000


@pytest.mark.parametrize("key", [None, KEY], ids=["open", "keyed"])
def test_many_at_the_peer(key):
    peer = Peer(SIGNATURE, key)

    def ask(datagram):
        done = peer.receive(datagram, 0)
        return peer.outputs(answers(VALUES), 0.0) if isinstance(done, Request) else done

    proxy = HandProxy(SIGNATURE, ask, key)
    proxy.begin(SESSION, VALUES)
    datagrams = malformed("peer", SIGNATURE, key)

    def step(i):
        assert peer.receive(datagrams[i % len(datagrams)], 0) is None
        if i % 1000 == 0:
            proxy.step(0.0, 0.5, VALUES)

    check_growth(step)
    assert peer.counters.malformed + peer.counters.forged == MANY


@pytest.mark.skipif(not shutil.which("gcc"), reason="NO gcc")
@pytest.mark.parametrize("key", [None, KEY], ids=["open", "keyed"])
@pytest.mark.parametrize("side", ["client", "peer"])
def test_many_in_c(tmp_path, side, key):
    if side == "client":
        write_sources(tmp_path)
    else:
        (tmp_path / "every_kind.h").write_text(bench_header("EveryKind", SIGNATURE), "ascii")
    program = tmp_path / "malformed"
    flags = ["-std=c99", "-O1", "-D_GNU_SOURCE", "-fsanitize=undefined", "-fno-sanitize-recover"]
    defined = ["-DPROXY"] if side == "client" else []
    files = ["-I", str(tmp_path), str(SOURCE), "-o", str(program)]
    subprocess.run(["gcc", *flags, *defined, *files, "-lm"], check=True)
    datagrams = malformed(side, SIGNATURE, key)
    pipe = b"".join(struct.pack("=I", len(d)) + d for d in datagrams)
    command = [str(program), key.decode() if key else "-", str(MANY)]
    done = subprocess.run(command, input=pipe, capture_output=True)
    assert done.returncode == 0, (done.stdout, done.stderr)
    counted, before, after = map(int, done.stdout.split())
    assert counted == MANY
    assert after - before < 64
