"""Where CI is set, quick tests fail for the processor time that they take, too.

A test's time is its own and that of the processes it waited for, without that of its fixtures: what
many share, one of them makes. The quick tests take 0.4 s each at most, and 150 s together, 180 s in
a fresh clone, where what is kept is built; a machine twice as slow keeps the limits.
"""

import os

import pytest
from _pytest.runner import runtestprotocol
from hypothesis import settings

ONE, ALL = 1.5, 400.0
"""s for a quick test, and for all with what the processes of the tests do besides."""

LONGER = {"slow", "platforms", "interop"}


@pytest.hookimpl(trylast=True)  # when the profile is chosen
def pytest_configure(config):
    """Count where CI is set, unless a property is tried on more examples than usual."""
    if "CI" in os.environ and settings.get_current_profile_name() == "usual":
        config.pluginmanager.register(_Budget(hasattr(config, "workerinput")))


class _Budget:
    """What the tests took; with pytest-xdist, whose main process waits for the others."""

    def __init__(self, other):
        self._other = other
        self._quick = True
        self._last = 0.0
        self._over = ""

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self):
        before = _used()
        try:
            return (yield)
        finally:
            self._last = _used() - before

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item, nextitem):
        """One that takes long may have built what is kept: if so, not a second time."""
        self._last = 0.0
        done = yield
        if self._last > ONE and not LONGER & {mark.name for mark in item.iter_markers()}:
            runtestprotocol(item, log=False, nextitem=nextitem)
            if self._last > ONE:
                said = f"{self._last:.2f} s of processor time; a quick test: at most {ONE:g} s"
                report = pytest.TestReport(item.nodeid, item.location, {}, "failed", said, "call")
                item.ihook.pytest_runtest_logreport(report=report)
        return done

    def pytest_runtest_logreport(self, report):
        self._quick = self._quick and not LONGER & set(report.keywords)

    @pytest.hookimpl(trylast=True)  # when the others have ended
    def pytest_sessionfinish(self, session):
        if self._quick and not self._other and (time := _used()) > ALL:
            self._over = f"{time:.0f} s of processor time; the quick tests: at most {ALL:g} s"
            if session.exitstatus == pytest.ExitCode.OK:
                session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter):
        if self._over:
            terminalreporter.write_line(self._over, red=True)


def _used():
    """Processor time in s of this process and of those that it has waited for."""
    return sum(os.times()[:4])
