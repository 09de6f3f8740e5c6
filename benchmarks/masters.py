"""What a macro step of the grasp costs in grasp-cosim and in other masters, in one run.

    grasp-cosim build --native
    python -m benchmarks.masters [--cofmupy-python PYTHON] [--before PYTHON] [--native FOLDER]
        [--only CASE]

Runs the loop of four instances and ten connections at 10 kHz with the Jacobi scheme, and records
everything. The masters take turns in chunks, with our Python FMUs and with our native ones. With
native ones the limit is there, too: the same blocks as one program of plain C. Then come a sweep
against its bare loops, and the start of a command against that of numpy. Prints the tables of
README.md. A master that is not installed is skipped by name; cofmupy pins an FMPy and a matplotlib,
so it may be in its own environment, as an earlier grasp-cosim must be."""

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from grasp_cosim import System, simulate, sweep
from grasp_cosim.base.system_calls import cpus
from grasp_cosim.fmu_export.build import build
from grasp_cosim.grasp.presets import SYSTEM

from .bare import bare_program

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


BARE, UNRECORDED, BEFORE = "bare C", "grasp-cosim unrecorded", "grasp-cosim before"

MASTERS = {
    BARE: Master("grasp_cosim", "21 outputs in memory, no checks, no FMI"),
    UNRECORDED: Master("grasp_cosim", "nothing, but every row is checked"),
    "grasp-cosim compiled": Master("grasp_cosim", "21 outputs in memory"),
    "grasp-cosim python": Master("grasp_cosim", "21 outputs in memory"),
    BEFORE: Master("grasp_cosim", "21 outputs in memory"),
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


def pythons(others: Mapping[str, str | None]) -> dict[str, str]:
    """The interpreter of each master that can be run; says which cannot.

    `others` are those that need not be this one, by master.
    """
    found = {}
    for name, (module, _) in MASTERS.items():
        python = others.get(name) or sys.executable
        if name == BEFORE and python == sys.executable:
            continue
        if subprocess.run([python, "-c", f"import {module}"], capture_output=True).returncode:
            print(f"{name}: skipped, {python} has no {module}", file=sys.stderr)
        else:
            found[name] = python
    return found


def measure(
    masters: dict[str, str], folders: Mapping[str, Path], case: Case, scratch: Path
) -> dict[str, list[float]]:
    """Us per macro step of all masters with the FMUs of a case, chunk by chunk alternately.

    `folders` has them by kind; an earlier grasp-cosim makes its own. What the masters leave behind
    goes to `scratch`.
    """
    environment = {**os.environ, "TMPDIR": str(scratch)}
    core = [str(cpus()[-1])] if case.one_core else []
    only_native = (BARE, UNRECORDED)
    with ExitStack() as stack:
        workers = {}
        for name, python in masters.items():
            if case.fmus != "native" and name in only_native:
                continue
            folder = folders[case.fmus]
            if name == BEFORE:
                folder = _built_before(python, case.fmus, scratch)
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


def _built_before(python: str, kind: str, scratch: Path) -> Path:
    """The FMUs of an earlier grasp-cosim."""
    folder = scratch / f"{kind}_before"
    options = ["--native"] if kind == "native" else []
    command = [python, "-m", "grasp_cosim", "build", *options, "--out", str(folder)]
    subprocess.run(command, capture_output=True, check=True)
    return folder


def chunk(worker: Program, steps: int) -> float:
    """Us per macro step over so many."""
    return 1e6 * float(worker.ask(str(steps))) / steps


def report(title: str, times: dict[str, list[float]]) -> None:
    """Print us per macro step as a table, and the ratio to our time.

    "times ours" is the median over the rounds, in which all masters meet the machine in the same
    mood.
    """
    ours = times[REFERENCE]
    bare = times.get(BARE)
    print(f"\n| {title} | best | median | worst | times ours | times bare C | recorded |")
    print("|---" * 7 + "|", flush=True)
    for name, chunks in times.items():
        costs = [f"{of(chunks):.2f} us" for of in (min, statistics.median, max)]
        of_bare = f"{ratio(chunks, bare):.2f}" if bare else ""
        cells = name, *costs, f"{ratio(chunks, ours):.2f}", of_bare
        print("|", " | ".join([*cells, MASTERS[name].recorded]), "|", flush=True)
    if bare:
        shares = {
            "models": ratio(bare, ours),
            "FMI calls, copies and checks": ratio(times[UNRECORDED], ours) - ratio(bare, ours),
            "rows to memory": 1.0 - ratio(times[UNRECORDED], ours),
        }
        print(*(f"{name}: {100 * share:.0f} %" for name, share in shares.items()), sep=", ")


def ratio(times: Sequence[float], others: Sequence[float]) -> float:
    """The median of the ratios within a turn."""
    return statistics.median(t / other for t, other in zip(times, others, strict=True))


def report_sweep(folder: Path, scratch: Path, runs: int = 200, rounds: int = 5) -> None:
    """Print the processor time of a sweep of grasps of 3 s, and of one more run from Python.

    The ratio is to as many bare loops, in the same turn.
    """
    system = System.load(SYSTEM, folder).with_experiment(step=1e-4, stop=3.0, scheme="jacobi")
    system = system.with_natives({c.name: c.fmu for c in system.components})
    program = bare_program(system, 1e-4, scratch)
    rows = [{"plant.object_width": 0.06 + 1e-5 * i} for i in range(runs)]
    short = system.with_experiment(stop=1e-3)
    simulate(short)
    measures = {
        "bare loop": lambda: cpu(lambda: program.advance(system.total_steps), 20),
        "grasp of a sweep": lambda: cpu(lambda: sweep(system, rows)) / runs,
        "run of 10 steps and its metrics": lambda: cpu(lambda: simulate(short).measured, 50),
    }
    found = by_turns(measures, rounds)
    print("\n| processor time | best | median | times the bare loop |\n|---|---|---|---|")
    for name, times in found.items():
        costs = [f"{1e3 * of(times):.2f} ms" for of in (min, statistics.median)]
        print("|", " | ".join([name, *costs, f"{ratio(times, found['bare loop']):.2f}"]), "|")


def cpu(act: Callable[[], object], times: int = 1) -> float:
    """The processor time in s of one of so many calls, with the processes that they wait for."""
    begin = _cpu_now()
    for _ in range(times):
        act()
    return (_cpu_now() - begin) / times


def _cpu_now() -> float:
    if sys.platform == "win32":
        raise SystemExit("benchmarks.masters: needs a system that counts the time of children")
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def report_starts(rounds: int = 15) -> None:
    """Print the time in s of commands from start to end, and the ratio to that of numpy."""
    command = [sys.executable, "-m", "grasp_cosim"]
    commands = {
        "import numpy": [sys.executable, "-c", "import numpy"],
        "grasp-cosim --version": [*command, "--version"],
        "grasp-cosim run --stop 0.001": [*command, "run", "--stop", "0.001"],
    }
    environment = {n: v for n, v in os.environ.items() if n != "PYTHONDONTWRITEBYTECODE"}

    def taken(arguments: Sequence[str]) -> float:
        begin = time.perf_counter()
        subprocess.run(arguments, env=environment, capture_output=True, check=True)
        return time.perf_counter() - begin

    measures = {name: partial(taken, arguments) for name, arguments in commands.items()}
    found = by_turns(measures, rounds)
    print("\n| start | best | median | times that of numpy |\n|---|---|---|---|")
    for name, times in found.items():
        costs = [f"{1e3 * of(times):.0f} ms" for of in (min, statistics.median)]
        print("|", " | ".join([name, *costs, f"{ratio(times, found['import numpy']):.2f}"]), "|")


def main() -> None:
    """Build the FMUs, run every master on both kinds, print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--cofmupy-python", metavar="PYTHON", help="a Python that has cofmupy; default: this one"
    )
    parser.add_argument(
        "--before", metavar="PYTHON", help="a Python that has an earlier grasp-cosim"
    )
    parser.add_argument(
        "--native", metavar="FOLDER", type=Path, default=Path("fmus/native"),
        help="what `grasp-cosim build --native` wrote; default: %(default)s",
    )  # fmt: skip
    parser.add_argument(
        "--only", choices=("python", "native", "sweep", "start"), help="what to measure"
    )
    given = parser.parse_args()
    masters = pythons({"cofmupy": given.cofmupy_python, BEFORE: given.before})
    with tempfile.TemporaryDirectory(prefix="grasp_bench_") as scratch:
        folders = {"python": Path(scratch, "python"), "native": given.native.resolve()}
        build(folders["python"])
        for case in CASES:
            if not any(folders[case.fmus].glob("*.fmu")):
                print(f"{case.title}: skipped, build them with `grasp-cosim build --native`")
            elif given.only in (None, case.fmus):
                report(case.title, measure(masters, folders, case, Path(scratch)))
        if given.only in (None, "sweep"):
            of_bare = Path(scratch, "bare")
            of_bare.mkdir()
            report_sweep(folders["native"], of_bare)
        if given.only in (None, "start"):
            report_starts()


if __name__ == "__main__":
    main()
