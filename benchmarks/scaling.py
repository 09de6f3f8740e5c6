"""How time and memory grow with rows, signals and components: python -m benchmarks.scaling

    python -m benchmarks.scaling [--quick] [--only rows|signals|components] [--best N]

TMPDIR=/dev/shm keeps the files in memory, so that the times are not those of a disk.

Each part at each size has its own process, which prepares what the part needs and measures it after
a small one of its kind. Memory is the growth of the peak of the process meanwhile. Rows are those
of the native grasp at 1 kHz, and signals are the outputs of one FMU. Components are a chain of FMUs
with one input and one output. Times are of the processor, which others that run on the machine
change less; standard error has those of the wall clock, too. The exponent is that of the time as a
power of the size.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, redirect_stdout
from functools import partial
from io import StringIO
from pathlib import Path
from typing import NamedTuple
from zipfile import ZipFile

import numpy as np
from grasp_cosim import Session, System, cli, grasp_system, load_run, simulate
from grasp_cosim.base.c_compilers import Job, compile_all, find_compiler
from grasp_cosim.fmi.instance import Instance
from grasp_cosim.fmi.load import load
from grasp_cosim.interface.obstacles import this_machine
from grasp_cosim.master.master import Master
from grasp_cosim.ssp.to_archive import write_ssp

SOURCE = Path(__file__).with_name("lag.c")
PEAK = Path("/proc/self/clear_refs")
"""Linux takes "5" there, and the peak of the memory of the process is that of now."""

STEPS = 100
"""Of a run of signals or components."""

FITTED = 3
"""The exponent is fitted to so many of the largest sizes."""

LONG = 60.0
"""s after which a part is not measured again."""

WHAT = ("time", "memory")

Act = Callable[[], object]


class Cost(NamedTuple):
    """What a part took: s, s of the processor, and bytes of memory."""

    seconds: float
    processor: float
    memory: float


# What is measured


def lag(outputs: int, folder: Path) -> Path:
    """The FMU of lag.c with so many outputs, in a folder; it is written once."""
    path = folder / f"lag_{outputs}.fmu"
    if not path.is_file():
        job = Job("lag", {"lag.c": SOURCE.read_bytes()}, find_compiler())
        (library,) = compile_all([job], folder)
        with ZipFile(path, "w") as archive:
            archive.writestr("modelDescription.xml", description(outputs))
            archive.write(library, f"binaries/{this_machine('2.0')}/lag{library.suffix}")
    return path


def description(outputs: int) -> str:
    """Its model description."""
    form = '<ScalarVariable name="{}" valueReference="{}" causality="{}"{}</ScalarVariable>'
    variables = [form.format("u", 0, "input", '><Real start="1"/>')]
    calculated = ' initial="calculated"><Real/>'
    variables += [form.format(f"y[{i}]", i, "output", calculated) for i in range(1, outputs + 1)]
    unknowns = "".join(f'<Unknown index="{i + 2}" dependencies="1"/>' for i in range(outputs))
    return (
        '<?xml version="1.0"?><fmiModelDescription fmiVersion="2.0" modelName="lag" guid="lag">'
        '<CoSimulation modelIdentifier="lag" canHandleVariableCommunicationStepSize="true"/>'
        f'<DefaultExperiment startTime="0" stopTime="{STEPS / 1000}" stepSize="0.001"/>'
        f"<ModelVariables>{''.join(variables)}</ModelVariables><ModelStructure>"
        f"<Outputs>{unknowns}</Outputs><InitialUnknowns>{unknowns}</InitialUnknowns>"
        "</ModelStructure></fmiModelDescription>"
    )


def chain(components: int, outputs: int, folder: Path) -> Path:
    """The system file of a chain of such FMUs, each with so many outputs."""
    path, fmu = folder / f"chain_{components}_{outputs}.toml", lag(outputs, folder).name
    links = [f'  "c{i}.y[1] -> c{i + 1}.u",\n' for i in range(components - 1)]
    head = f"connections = [\n{''.join(links)}]\n"
    experiment = f"[experiment]\nstep = 0.001\nstop = {STEPS / 1000}\n"
    tables = [f"[components.c{i}]\nfmu = '{fmu}'\n" for i in range(components)]
    path.write_text(
        f"{head}{experiment}{''.join(tables)}[components.c0.values]\nu = 2.0\n", "utf-8"
    )
    return path


def command(*words: object) -> Act:
    """A command of grasp-cosim in this process, with its output in memory."""

    def act() -> None:
        with redirect_stdout(StringIO()):
            if cli.main(["--quiet", *map(str, words)]):
                raise SystemExit(f"{words}: failed")

    return act


class Rows:
    """Parts of a run of the grasp with so many rows; it is in a folder that other parts share."""

    def __init__(self, rows: int, folder: Path, _: ExitStack) -> None:
        self.stop = rows / 1000
        self.out = folder / f"run_{rows}"

    def simulated(self) -> Act:
        """Without a file."""
        return partial(simulate, grasp_system(), step=1e-3, stop=self.stop)

    def run(self) -> Act:
        """With a file: with the start of the command, the metrics and run.json."""
        times = ["--step", "1e-3", "--stop", self.stop]
        return command("run", *times, "--format", "arrow", "--out", self.out)

    def read(self) -> Act:
        """All signals, and the metrics."""
        if not self.out.is_dir():
            self.run()()

        def act() -> None:
            result = load_run(self.out)
            for name in result.signals:
                np.sum(result.signals[name])
            _ = result.metrics

        return act


class Chain:
    """Parts of a chain of so many components with so many outputs each."""

    def __init__(self, components: int, outputs: int, folder: Path, stack: ExitStack) -> None:
        self.file, self.stack = chain(components, outputs, folder), stack
        self.fmu, self.folder = lag(outputs, folder), folder

    def system(self) -> System:
        return System.load(self.file)

    def instances(self, system: System) -> list[Instance]:
        """The instances of a system, which are closed at the end."""
        instances = []
        for component in system.components:
            instances.append(load(component))
            self.stack.callback(instances[-1].close)
        return instances

    def plan(self) -> Callable[[], Master]:
        """The master makes its plan and its loop."""
        system = self.system()
        return partial(Master, system, self.instances(system), lambda *_: None, "compiled")

    def session(self, system: System) -> Session:
        """The session of a system, which is closed at the end."""
        session = simulate.session(system, engine="compiled")
        self.stack.callback(session.close)
        return session

    def read(self) -> Act:
        return self.system

    def load(self) -> Act:
        return partial(self.instances, self.system())

    def initialise(self) -> Act:
        return self.plan()().initialise

    def start(self) -> Act:
        """All of the parts above but the first, and what keeps the rows."""
        return partial(self.session, self.system())

    def steps(self) -> Act:
        return partial(self.session(self.system()).step, STEPS)

    def close(self) -> Act:
        return self.session(self.system()).close

    def run(self, form: str) -> Act:
        """A whole run with a file."""
        out = self.folder / f"{self.file.stem}_{form}"
        return command("run", self.file, "--format", form, "--out", out)

    def inspect(self) -> Act:
        return command("inspect", self.fmu)

    def init(self) -> Act:
        return command("init", self.folder / "new.toml", "--force", "--fmu", f"a={self.fmu}")

    @property
    def archive(self) -> Path:
        return self.file.with_suffix(".ssp")

    def write_ssp(self) -> Act:
        return partial(write_ssp, self.system(), self.archive)

    def read_ssp(self) -> Act:
        if not self.archive.is_file():
            self.write_ssp()()
        return partial(System.load, self.archive)


# The table


class Dimension(NamedTuple):
    """What grows: a thing of it, its sizes, how one is made, and the parts to measure by name.

    The small size is measured first, for what is imported and compiled only once.
    """

    unit: str
    small: int
    sizes: Sequence[int]
    quick_sizes: Sequence[int]
    subject: Callable[[int, Path, ExitStack], object]
    parts: Mapping[str, Callable[..., Act]]


OF_ROWS: Mapping[str, Callable[..., Act]] = {
    "`simulate()`": Rows.simulated,
    "`run --format arrow --out`": Rows.run,
    "`load_run()`, all signals, metrics": Rows.read,
}
OF_CHAINS: Mapping[str, Callable[..., Act]] = {
    "`System.load()`": Chain.read,
    "loading the FMUs": Chain.load,
    "plan": Chain.plan,
    "initialising": Chain.initialise,
    "opening a session": Chain.start,
    f"{STEPS} steps": Chain.steps,
    "closing the session": Chain.close,
    "`run --format arrow --out`": partial(Chain.run, form="arrow"),
    "`run --format csv --out`": partial(Chain.run, form="csv"),
    "writing an SSP archive": Chain.write_ssp,
    "reading the archive": Chain.read_ssp,
}
OF_FMUS: Mapping[str, Callable[..., Act]] = {
    "`inspect`": Chain.inspect,
    "`init --fmu`": Chain.init,
}

MINUTE = 60_000
"""Rows of a minute."""


def chain_of(size: int, folder: Path, stack: ExitStack) -> Chain:
    return Chain(size, 1, folder, stack)


DIMENSIONS = {
    "rows": Dimension(
        "row", 1000, [minutes * MINUTE for minutes in (1, 4, 16, 60)],
        (2000, 4000, 8000), Rows, OF_ROWS,
    ),
    "signals": Dimension(
        "signal", 10, (200, 1000, 5000, 20_000),
        (50, 100, 200), partial(Chain, 1), {**OF_CHAINS, **OF_FMUS},
    ),
    "components": Dimension(
        "component", 10, (50, 200, 1000, 5000), (10, 20, 40), chain_of, OF_CHAINS
    ),
}  # fmt: skip


def peak() -> int:
    """The most bytes that this process has had since `forget_peak()`."""
    if sys.platform == "win32":
        raise SystemExit("benchmarks.scaling: needs Linux, where /proc has the peak of the memory")
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def forget_peak() -> int:
    """The bytes that this process has now, which its peak begins with."""
    PEAK.write_text("5")
    return peak()


def measure(dimension: Dimension, part: str, size: int, folder: Path) -> Cost:
    """What a part takes, in this process."""
    prepare = dimension.parts[part]
    with ExitStack() as stack:
        prepare(dimension.subject(dimension.small, folder, stack))()
    with ExitStack() as stack:
        act = prepare(dimension.subject(size, folder, stack))
        before, start, busy = forget_peak(), time.perf_counter(), time.process_time()
        kept = act()
        cost = Cost(time.perf_counter() - start, time.process_time() - busy, peak() - before)
        del kept
    return cost


def measured(name: str, part: str, size: int, folder: Path, times: int) -> Cost:
    """The least that a part takes in so many processes, or in fewer where it takes long."""
    command = [sys.executable, "-m", "benchmarks.scaling", "--folder", str(folder)]
    command += ["--only", name, "--part", part, "--size", str(size)]
    costs: list[Cost] = []
    while len(costs) < times and sum(cost.seconds for cost in costs) < LONG:
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
        costs.append(Cost(*map(float, done.stdout.split())))
    return Cost(*map(min, zip(*costs, strict=True)))


def exponent(sizes: Sequence[float], values: Sequence[float]) -> float:
    """The power of the size that the values grow with, fitted to the largest sizes."""
    slope, _ = np.polyfit(np.log(sizes[-FITTED:]), np.log(values[-FITTED:]), 1)
    return float(slope)


def in_bytes(memory: float) -> str:
    """Bytes in words, to three digits."""
    return f"{memory:.3g} B" if memory < 999.5 else f"{memory / 1000:.3g} kB"


def in_time(seconds: float) -> str:
    """A time in words, to three digits."""
    return f"{1e6 * seconds:.3g} us" if seconds < 999.5e-6 else f"{1000 * seconds:.3g} ms"


def row(part: str, costs: Mapping[int, Cost]) -> str:
    """A row of the table: the time of the largest size, time and memory of a thing, exponent."""
    size = max(costs)
    _, seconds, memory = costs[size]
    grown = exponent([*costs], [cost.processor for cost in costs.values()])
    cells = part, f"{seconds:.2f} s", in_time(seconds / size), in_bytes(memory / size)
    return f"| {' | '.join((*cells, f'{grown:.2f}'))} |"


def table(name: str, sizes: Sequence[int], folder: Path, times: int) -> str:
    """Print the table of a dimension as it is measured; a line on its slowest part."""
    dimension = DIMENSIONS[name]
    found: dict[str, float] = {}
    head = f"{sizes[-1]:,} {name}", "time", *(f"{what} per {dimension.unit}" for what in WHAT)
    print(f"\n| {' | '.join((*head, 'exponent'))} |\n{'|---' * 5}|", flush=True)
    for part in dimension.parts:
        costs = {size: measured(name, part, size, folder, times) for size in sizes}
        found[part] = costs[sizes[-1]].processor
        print(row(part, costs), flush=True)
        words = [f"{size}: {c.seconds:.4f} s ({c.processor:.4f} s)" for size, c in costs.items()]
        print(f"{name}, {part}: {', '.join(words)}", file=sys.stderr, flush=True)
    slowest = max(found, key=lambda part: found[part])
    return f"slowest of {name}: {slowest}, {found[slowest]:.2f} s"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="measure small sizes")
    parser.add_argument("--only", choices=DIMENSIONS, help="what grows")
    parser.add_argument("--best", type=int, default=2, metavar="N", help="best of N [%(default)s]")
    for option, kind in {"--part": str, "--size": int, "--folder": Path}.items():
        parser.add_argument(option, type=kind, help=argparse.SUPPRESS)  # of a process of ours
    given = parser.parse_args()
    if given.part:
        print(*measure(DIMENSIONS[given.only], given.part, given.size, given.folder))
        return
    lines = []
    with tempfile.TemporaryDirectory(prefix="grasp_bench_") as folder:
        for name in [given.only] if given.only else DIMENSIONS:
            dimension = DIMENSIONS[name]
            sizes = dimension.quick_sizes if given.quick else dimension.sizes
            lines.append(table(name, sizes, Path(folder), given.best))
    print("", *lines, sep="\n")


if __name__ == "__main__":
    main()
