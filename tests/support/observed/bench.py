"""A bench in C whose outputs are observed, and a host of its own, each a process."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from grasp_cosim.fmu_export.native.bench_header import bench_header
from grasp_cosim.fmu_export.native.c_only import write_c
from grasp_cosim.fmu_export.package import shipped_model

from .plant import SIGNATURE, START

HERE = Path(__file__).parent
WATCHDOG = 0.05
"""s of the bench's."""
PERIOD = 0.001
"""s of its own clock, and of the host."""
ENTRIES = 1 << 16
ENTRY = np.dtype([("ns", "i8"), ("first", "f8"), ("second", "f8"), ("writer", "i8")])

LIFE = 60.0
"""s after which a test is broken off."""


def build(folder):
    """The bench, compiled from the header and its example."""
    (folder / "gripper_plant.h").write_text(bench_header("GripperPlant", SIGNATURE, START), "ascii")
    write_c(folder, shipped_model("GripperPlant"))
    command = [
        "gcc", "-std=c99", "-O1", "-D_POSIX_C_SOURCE=200809L", f"-I{folder}",
        f"-DGRIPPER_PLANT_TIMEOUT_NS={int(WATCHDOG * 1e9)}", HERE / "observed_bench.c",
        folder / "GripperPlant.c", folder / "GripperPlant_text.c", "-o", folder / "bench", "-lm",
    ]  # fmt: skip
    subprocess.run([*map(str, command)], check=True)
    return folder / "bench"


class Dac:
    """What was written to the outputs of a bench, in the order of time."""

    def __init__(self, path):
        self.path = path
        path.write_bytes(bytes(8 + ENTRIES * ENTRY.itemsize))

    def entries(self):
        data = self.path.read_bytes()
        count = int(np.frombuffer(data, "i8", 1)[0])
        assert count <= ENTRIES
        found = np.frombuffer(data, ENTRY, count, 8)
        found = found[found["ns"] > 0]
        return found[np.argsort(found["ns"], kind="stable")]

    def is_safe(self):
        """True if what was written last is safe."""
        entries = self.entries()
        return bool(len(entries)) and safe(entries[-1])


def safe(entry):
    return entry["first"] == 0.0 and entry["second"] == 0.0


class Bench:
    """A running bench; `period` None for lockstep."""

    def __init__(self, program, dac, port=0, period=PERIOD, fail_at=None):
        environment = os.environ | {"DAC": str(dac.path)}
        environment |= {} if fail_at is None else {"FAIL_AT": str(fail_at)}
        words = [] if period is None else ["-", str(period)]
        self.process = subprocess.Popen(
            [program, str(port), *words], env=environment, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        self.port = int(self.process.stdout.readline().split()[-1])

    def end(self):
        end(self.process)


def end(process):
    """Kill it, also where it is stopped."""
    with suppress(ProcessLookupError):
        process.kill()
    process.wait(LIFE)
    if process.stdout:
        process.stdout.close()


def start_host(port, name="plant"):
    """The host, once it steps."""
    paths = os.pathsep.join([str(HERE.parent.parent), os.environ.get("PYTHONPATH", "")])
    host = subprocess.Popen(
        [sys.executable, HERE / "host.py", str(port), name], text=True, stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": paths},
    )  # fmt: skip
    assert host.stdout.readline() == "stepping\n"
    return host


@contextmanager
def running(program, folder, period=PERIOD, fail_at=None):
    """A bench that a host steps, and its outputs."""
    dac = Dac(folder / "dac")
    bench = Bench(program, dac, 0, period, fail_at)
    host = None
    try:
        host = start_host(bench.port)
        wait_until(lambda: len(dac.entries()) > 20 or fail_at)
        yield bench, host, dac
    finally:
        bench.end()
        if host is not None:
            end(host)


def wait_until(holds):
    deadline = time.monotonic() + LIFE
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.002)


def stop(process):
    process.send_signal(signal.SIGSTOP)


def go_on(process):
    process.send_signal(signal.SIGCONT)
