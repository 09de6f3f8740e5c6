"""Shared by the benchmarks: programs that answer, measuring by turns, and tables."""

import statistics
import subprocess
from collections.abc import Callable, Mapping, Sequence
from typing import Any


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
