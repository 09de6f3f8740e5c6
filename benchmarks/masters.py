"""What a macro step of the grasp costs in grasp-cosim and in other masters, in one run.

    python -m benchmarks.masters [--cofmupy-python PYTHON]

Runs the loop of four instances and ten connections at 10 kHz with the Jacobi scheme, everything
recorded, on our Python FMUs and on native ones of the same shape, in short chunks, one master after
the other. Prints the table of README.md. A master that is not installed is skipped by
name; cofmupy pins an FMPy and a matplotlib of its own, so it may be in an environment of its own.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from grasp_fmus.build import build

from benchmarks.native_fmus import build_native

WORKER = Path(__file__).parent / "worker.py"

RECORDING = {
    "grasp-cosim compiled": "21 outputs in memory",
    "grasp-cosim python": "21 outputs in memory",
    "ecospy": "21 outputs, its CSV writer",
    "libcosimpy": "19 real outputs in memory, its time series observer",
    "cofmupy": "19 real outputs in memory, its results",
}
"""The masters by the names that worker.py knows, and what they record."""

REFERENCE = "grasp-cosim compiled"

MODULES = {"ecospy": "ecospy", "libcosimpy": "libcosimpy", "cofmupy": "cofmupy"}
"""What must be installed for a master."""


class Case(NamedTuple):
    """What is measured: the FMUs, macro steps to a chunk, chunks of each master, one core only?"""

    title: str
    native: bool
    steps: int
    rounds: int
    one_core: bool


CASES = (
    Case("Python FMUs, all cores, long chunks", False, 5000, 10, False),
    Case("Python FMUs, all cores", False, 300, 60, False),
    Case("Python FMUs, one core", False, 300, 60, True),
    Case("native FMUs, all cores", True, 1000, 60, False),
)
"""ecospy and libcosimpy step their instances in several threads, which a Python FMU makes wait for
one another: there one core can be faster than two, and a long chunk slower than a short one.
"""


class Cost(NamedTuple):
    """us per macro step of the best chunk, the middle one and the slowest; and how many times ours
    that is: the median over the rounds, in which all masters meet the machine in the same mood.
    """

    best: float
    median: float
    worst: float
    ratio: float


class Worker:
    """A master in its process."""

    def __init__(self, python: str, name: str, folder: Path, one_core: bool) -> None:
        self.name = name
        core = [str(max(os.sched_getaffinity(0)))] if one_core else []
        self._process = subprocess.Popen(
            [python, str(WORKER), name, str(folder), *core],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**os.environ, "TMPDIR": str(folder.parent)},
        )
        self._read()

    def chunk(self, steps: int) -> float:
        """The time per macro step of a chunk, in us."""
        return 1e6 * float(self._ask(str(steps))) / steps

    def position(self) -> float:
        """Where finger 1 is, in m."""
        return float(self._ask(""))

    def close(self) -> None:
        """End it hard: the C++ masters print and crash on the way out."""
        self._process.kill()
        self._process.communicate()

    def _ask(self, text: str) -> str:
        assert self._process.stdin is not None  # noqa: S101 - it is a pipe
        self._process.stdin.write(f"{text}\n")
        self._process.stdin.flush()
        return self._read()

    def _read(self) -> str:
        assert self._process.stdout is not None  # noqa: S101 - it is a pipe
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"{self.name}: ended with {self._process.wait()}")
        return line


def pythons(cofmupy_python: str | None) -> dict[str, str]:
    """The interpreter of each master that can be run; says which cannot."""
    found = {}
    for name in RECORDING:
        python = cofmupy_python if name == "cofmupy" and cofmupy_python else sys.executable
        module = MODULES.get(name, "numba" if name.endswith("compiled") else "grasp_cosim")
        if subprocess.run([python, "-c", f"import {module}"], capture_output=True).returncode:
            print(f"{name}: skipped, {python} has no {module}", file=sys.stderr)
        else:
            found[name] = python
    return found


def measure(masters: dict[str, str], folder: Path, case: Case) -> dict[str, Cost]:
    """The cost of all masters with the FMUs of a folder, chunk by chunk alternately."""
    with ExitStack() as stack:
        workers = []
        for name, python in masters.items():
            workers.append(Worker(python, name, folder, case.one_core))
            stack.callback(workers[-1].close)
        times: dict[str, list[float]] = {worker.name: [] for worker in workers}
        for _ in range(case.rounds):
            for worker in workers:
                times[worker.name].append(worker.chunk(case.steps))
        for worker in workers:
            print(f"{worker.name}: finger 1 at {worker.position():.5f} m", file=sys.stderr)
    return {name: _cost(chunks, times[REFERENCE]) for name, chunks in times.items()}


def _cost(chunks: list[float], reference: list[float]) -> Cost:
    ratio = statistics.median(t / own for t, own in zip(chunks, reference, strict=True))
    return Cost(min(chunks), statistics.median(chunks), max(chunks), ratio)


def table(results: dict[str, dict[str, Cost]]) -> str:
    """The results as Markdown: us per macro step, and how many times ours that is."""
    lines = []
    for title, costs in results.items():
        lines += [
            "",
            f"| {title} | best | median | worst | times ours | best / our best | recorded |",
            "|---|---|---|---|---|---|---|",
        ]
        best = costs[REFERENCE].best
        lines += [
            f"| {name} | {c.best:.1f} us | {c.median:.1f} us | {c.worst:.1f} us | {c.ratio:.1f} "
            f"| {c.best / best:.1f} | {RECORDING[name]} |"
            for name, c in costs.items()
        ]
    return "\n".join(lines[1:])


def main() -> None:
    """Build the FMUs, run every master on both kinds, print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--cofmupy-python", metavar="PYTHON", help="a Python that has cofmupy; default: this one"
    )
    masters = pythons(parser.parse_args().cofmupy_python)
    if REFERENCE not in masters:
        sys.exit(f"{REFERENCE}: is what the others are compared with; install the extra `fast`")
    with tempfile.TemporaryDirectory(prefix="grasp_bench_") as name:
        python, native = Path(name, "python"), Path(name, "native")
        build(python)
        build_native(python, native)
        results = {c.title: measure(masters, native if c.native else python, c) for c in CASES}
    print(table(results))


if __name__ == "__main__":
    main()
