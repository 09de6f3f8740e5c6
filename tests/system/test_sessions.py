"""Sessions: what can be done with one, and when that is over."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmi.instances import KINDS, interrupted_after
from fmi.test_rejected_steps import alone
from grasp_cosim import InputError, SimulationError, System, simulate
from grasp_cosim.master.engine import Engine
from grasp_cosim.system.parts import Isolation
from native_fmus import needs_gcc

pytestmark = needs_gcc
engines = pytest.mark.parametrize("engine", ["python", "auto"])


@engines
def test_a_closed_session_calls_no_fmu(tmp_path: Path, engine: Engine) -> None:
    with simulate.session(alone(tmp_path, "3.0", "none"), engine=engine) as session:
        session.step(3)
    closed = "^alone: the session is closed; must be a new one$"
    with pytest.raises(InputError, match=closed):
        session.step()
    with pytest.raises(InputError, match=closed):
        session.set("part.gain", 2.0)
    assert session["part.x"] == pytest.approx(0.6)
    assert len(session.result().time) == 4


@engines
def test_after_a_failure_no_fmu_is_called(tmp_path: Path, engine: Engine) -> None:
    system = alone(tmp_path, "3.0", "none", error_at=0.35)
    with simulate.session(system, engine=engine) as session:
        with pytest.raises(SimulationError):
            session.step(5)
        for call in (session.step, lambda: session.set("part.gain", 2.0)):
            with pytest.raises(InputError, match="the session is broken off by a failure or an"):
                call()
        assert len(session.result().time) == 4


def test_a_value_that_does_not_fit_breaks_nothing(tmp_path: Path) -> None:
    with simulate.session(alone(tmp_path, "3.0", "none")) as session:
        with pytest.raises(InputError, match="must be a finite number"):
            session.set("part.gain", float("nan"))
        assert session.step(10)
        assert session.complete


@pytest.mark.parametrize(("version", "isolation"), KINDS)
def test_an_interrupted_session_does_not_go_on(
    tmp_path: Path, version: str, isolation: Isolation
) -> None:
    """Its FMU is further than its rows."""
    system = replace(alone(tmp_path, version, isolation), step_ns=1000, stop_ns=100_000_000_000)
    with simulate.session(system, engine="python") as session:
        with interrupted_after(0.05):
            session.step(100_000_000)
        with pytest.raises(InputError, match="the session is broken off by a failure or an"):
            session.step()
        result = session.result()
        assert not result.complete
        assert result["part.x"] == pytest.approx(2.0 * result.time, rel=1e-9)


def test_a_session_that_has_not_stepped_has_metrics(tmp_path: Path) -> None:
    with simulate.session(alone(tmp_path, "3.0", "none")) as session:
        metrics = session.result().metrics
    assert (metrics["steps"], metrics["real_time_factor"]) == (0, 0.0)


@pytest.mark.parametrize("steps", [0, -1, 1.5, True, 2**63])
def test_steps_are_counted_in_whole_numbers(grasp: System, steps: int) -> None:
    with simulate.session(grasp, stop=0.01) as session:
        with pytest.raises(InputError, match=r"steps = .*: must be a whole number from 1 to"):
            session.step(steps)
        assert session.step(np.int64(3))  # type: ignore[arg-type]
        assert session.time == 3e-4


def test_an_engine_that_does_not_exist_is_refused(grasp: System) -> None:
    with pytest.raises(InputError, match="engine = 'complied': must be one of auto, python, comp"):
        simulate(grasp, stop=1e-3, engine="complied")  # type: ignore[arg-type]
