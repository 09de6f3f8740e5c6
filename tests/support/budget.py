"""On the machine of CI quick tests fail, all being well, for the processor time that they take.

A test's time is its own and that of the processes it waited for, without that of its fixtures: what
many share, one of them makes. Quick tests take 0.4 s at most, and all together 150 s; a machine 1.7
times slower keeps the limits.
"""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

ONE, COLD = 1.0, 3.0
"""s for a test, and for one in a fresh clone, where the first of many compiles what is kept."""

ALL = 255.0
"""s for the quick tests together with what all processes of the tests do besides."""

LONGER = {"slow", "platforms", "interop"}
TIME = "processor time in s"


@pytest.hookimpl(trylast=True)  # when the profile is chosen
def pytest_configure(config: pytest.Config) -> None:
    """Count where CI is set, unless a property is tried on more examples than usual."""
    if "CI" in os.environ and settings.get_current_profile_name() == "usual":
        config.pluginmanager.register(_Budget(config))


class _Budget:
    """What the tests took; with pytest-xdist its main process adds up and judges."""

    def __init__(self, config: pytest.Config) -> None:
        self._judges = not hasattr(config, "workerinput")
        self._one = ONE if Path(os.environ["XDG_CACHE_HOME"]).exists() else COLD
        self._quick = True
        self._found: list[str] = []

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Iterator[None]:
        before = _used()
        try:
            return (yield)
        finally:
            item.user_properties.append((TIME, _used() - before))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if LONGER & set(report.keywords):
            self._quick = False
        elif report.when == "call" and (time := _time_of(report)) > self._one:
            self._found.append(
                f"{report.nodeid}: {time:.2f} s of processor time; a quick test must take at most "
                f"{self._one:g} s here"
            )

    @pytest.hookimpl(trylast=True)  # when the others have ended
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if self._quick and (time := _used()) > ALL:
            self._found.append(
                f"the quick tests: {time:.0f} s of processor time; must take at most {ALL:g} s here"
            )
        if self._judges and self._found and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        for line in self._found:
            terminalreporter.write_line(line, red=True)


def _used() -> float:
    """Processor time in s of this process and of those that it has waited for."""
    return sum(os.times()[:4])


def _time_of(report: pytest.TestReport) -> float:
    return next(float(str(value)) for name, value in report.user_properties if name == TIME)
