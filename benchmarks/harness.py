"""Shared by the benchmarks: the FMUs, programs that answer, measuring by turns, and tables.

A native FMU has the whole model description of one of ours, so that its ports, units and values are
the same, and another binary: see native/lag.c. It needs gcc; the headers of FMI are those that FMPy
brings along.
"""

import statistics
import subprocess
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fmpy
from grasp_fmus.build import build

LAG = Path(__file__).parent / "native" / "lag.c"
HEADERS = Path(fmpy.__file__).parent / "c-code"


@contextmanager
def built_fmus() -> Iterator[tuple[Path, Path]]:
    """A folder with our Python FMUs, and one with native ones of the same shape."""
    with tempfile.TemporaryDirectory(prefix="grasp_bench_") as name:
        python, native = Path(name, "python"), Path(name, "native")
        build(python)
        build_native(python, native)
        yield python, native


def build_native(fmus: Path, out: Path) -> None:
    """The native counterparts of all FMUs in a folder. FileNotFoundError without gcc."""
    out.mkdir()
    for fmu in sorted(fmus.glob("*.fmu")):
        description = fmpy.read_model_description(fmu)
        causalities = [v.causality for v in description.modelVariables]
        library = out / f"{fmu.stem}.so"
        macros = {
            "INPUTS": causalities.count("input"),
            "OUTPUTS": causalities.count("output"),
            "VARIABLES": len(causalities),
        }
        defined = [f"-D{name}={value}" for name, value in macros.items()]
        compiler = ["gcc", "-O2", "-shared", "-fPIC", "-I", str(HEADERS)]
        subprocess.run([*compiler, *defined, "-o", str(library), str(LAG)], check=True)
        with zipfile.ZipFile(out / fmu.name, "w") as archive, zipfile.ZipFile(fmu) as original:
            archive.writestr("modelDescription.xml", original.read("modelDescription.xml"))
            archive.write(library, f"binaries/linux64/{fmu.stem}.so")


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


def spread(values: Sequence[float]) -> tuple[float, float, float]:
    """The least, the middle and the largest."""
    return min(values), statistics.median(values), max(values)


def head(*names: str) -> None:
    """Print the heading of a table in Markdown."""
    print()
    row(*names)
    print("|---" * len(names) + "|", flush=True)


def row(*cells: object) -> None:
    """Print a row of a table."""
    print("|", " | ".join(map(str, cells)), "|", flush=True)
