"""What a macro step of the grasp costs in grasp-cosim and in other masters, in one run.

    grasp-cosim build --native
    python -m benchmarks.masters [--cofmupy-python PYTHON] [--native FOLDER] [--only CASE]

Runs the loop of four instances and ten connections at 10 kHz with the Jacobi scheme, and records
everything. The masters take turns in chunks, with our Python FMUs and with our native ones. Prints
the tables of README.md. A master that is not installed is skipped by name; cofmupy pins an FMPy and
a matplotlib, so it may be in its own environment."""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from grasp_cosim.base.system_calls import cpus
from grasp_cosim.fmu_export.build import build

WORKER = Path(__file__).parent / "worker.py"


class Program(subprocess.Popen[str]):
    """A process that answers each line with a line."""

    def __init__(self, *command: str, **options: Any) -> None:
        super().__init__(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **options
        )
        self.name = " ".join(command)

    def ask(self, line: str) -> str:
        """The answer to a line. RuntimeError where the process has ended instead."""
        print(line, file=self.stdin, flush=True)
        answer = self.stdout.readline() if self.stdout else ""
        if not answer:
            raise RuntimeError(f"{self.name}: ended with {self.wait()}")
        return answer


def by_turns(measures: Mapping[str, Callable[[], float]], rounds: int) -> dict[str, list[float]]:
    """What each of them finds, one after the other: they meet the machine in the same mood."""
    found: dict[str, list[float]] = {name: [] for name in measures}
    for _ in range(rounds):
        for name, measure in measures.items():
            found[name].append(measure())
    return found


class Master(NamedTuple):
    """What must be installed for a master, and what it records."""

    module: str
    recorded: str


MASTERS = {
    "grasp-cosim compiled": Master("grasp_cosim", "21 outputs in memory"),
    "grasp-cosim python": Master("grasp_cosim", "21 outputs in memory"),
    "ecospy": Master("ecospy", "21 outputs, its CSV writer"),
    "libcosimpy": Master("libcosimpy", "19 real outputs in memory, its time series observer"),
    "cofmupy": Master("cofmupy", "19 real outputs in memory, its results"),
}
"""By the names that worker.py knows."""

REFERENCE = "grasp-cosim compiled"


class Case(NamedTuple):
    """What is measured: the FMUs, macro steps to a chunk, chunks of each master, one core only?"""

    title: str
    fmus: str
    steps: int
    rounds: int
    one_core: bool


CASES = (
    Case("Python FMUs, all cores, long chunks", "python", 5000, 10, False),
    Case("Python FMUs, all cores", "python", 300, 60, False),
    Case("Python FMUs, one core", "python", 300, 60, True),
    Case("our native FMUs, runs of 3 s", "native", 30_000, 20, False),
    Case("our native FMUs, short chunks", "native", 1000, 60, False),
)
"""ecospy and libcosimpy step their instances in several threads, which a Python FMU makes wait for
one another: there one core can be faster than two, and a long chunk slower than a short one.
"""


def pythons(cofmupy_python: str | None) -> dict[str, str]:
    """The interpreter of each master that can be run; says which cannot."""
    found = {}
    for name, (module, _) in MASTERS.items():
        python = cofmupy_python if name == "cofmupy" and cofmupy_python else sys.executable
        if subprocess.run([python, "-c", f"import {module}"], capture_output=True).returncode:
            print(f"{name}: skipped, {python} has no {module}", file=sys.stderr)
        else:
            found[name] = python
    return found


def measure(
    masters: dict[str, str], folder: Path, case: Case, scratch: Path
) -> dict[str, list[float]]:
    """Us per macro step of all masters with the FMUs of a folder, chunk by chunk alternately.

    What the masters leave behind goes to `scratch`.
    """
    environment = {**os.environ, "TMPDIR": str(scratch)}
    core = [str(cpus()[-1])] if case.one_core else []
    with ExitStack() as stack:
        workers = {}
        for name, python in masters.items():
            command = [python, str(WORKER), name, str(folder), *core]
            worker = Program(*command, stderr=subprocess.DEVNULL, env=environment)
            stack.enter_context(worker)
            stack.callback(worker.kill)  # the C++ masters print and crash on the way out
            worker.ask("1")
            workers[name] = worker
        times = by_turns(
            {n: partial(chunk, w, case.steps) for n, w in workers.items()}, case.rounds
        )
        for name, worker in workers.items():
            print(f"{name}: finger 1 at {float(worker.ask('')):.5f} m", file=sys.stderr)
    return times


def chunk(worker: Program, steps: int) -> float:
    """Us per macro step over so many."""
    return 1e6 * float(worker.ask(str(steps))) / steps


def report(title: str, times: dict[str, list[float]]) -> None:
    """Print us per macro step as a table, and the ratio to our time.

    "times ours" is the median over the rounds, in which all masters meet the machine in the same
    mood.
    """
    ours = times[REFERENCE]
    print(f"\n| {title} | best | median | worst | times ours | best / our best | recorded |")
    print("|---" * 7 + "|", flush=True)
    for name, chunks in times.items():
        ratio = statistics.median(t / own for t, own in zip(chunks, ours, strict=True))
        costs = [f"{of(chunks):.2f} us" for of in (min, statistics.median, max)]
        cells = name, *costs, f"{ratio:.1f}", f"{min(chunks) / min(ours):.1f}"
        print("|", " | ".join([*cells, MASTERS[name].recorded]), "|", flush=True)


def main() -> None:
    """Build the FMUs, run every master on both kinds, print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--cofmupy-python", metavar="PYTHON", help="a Python that has cofmupy; default: this one"
    )
    parser.add_argument(
        "--native", metavar="FOLDER", type=Path, default=Path("fmus/native"),
        help="what `grasp-cosim build --native` wrote; default: %(default)s",
    )  # fmt: skip
    parser.add_argument("--only", choices=("python", "native"), help="FMUs to measure")
    given = parser.parse_args()
    masters = pythons(given.cofmupy_python)
    with tempfile.TemporaryDirectory(prefix="grasp_bench_") as scratch:
        folders = {"python": Path(scratch, "python"), "native": given.native.resolve()}
        build(folders["python"])
        for case in CASES:
            if not any(folders[case.fmus].glob("*.fmu")):
                print(f"{case.title}: skipped, build them with `grasp-cosim build --native`")
            elif given.only in (None, case.fmus):
                report(case.title, measure(masters, folders[case.fmus], case, Path(scratch)))


if __name__ == "__main__":
    main()
