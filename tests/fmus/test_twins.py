"""An FMU that Python runs and the native one, call by call: the same in all that a host can see.

Statuses, values, what is logged and the bytes of states; whatever is called, with whatever.
"""

from typing import Any

import pytest
from conftest import LoadAs
from grasp_fmus.shipped import blocks
from hypothesis import HealthCheck, given
from support.drawn_calls import SEQUENCES, Drawn
from support.examples import examples
from support.fmi2 import OK
from support.kinds import Kind
from support.twins import Twins

pytestmark = pytest.mark.kinds("native", "native FMI 3")

NAMES = [*blocks(), "SpringPlant"]


@pytest.mark.hypothesis
@pytest.mark.parametrize("name", NAMES)
def test_any_sequence_of_calls(load_as: LoadAs, kind: Kind, name: str) -> None:
    @given(sequence=SEQUENCES)
    @examples(100, suppress_health_check=list(HealthCheck))
    def run(sequence: list[tuple[int, tuple[Any, ...]]]) -> None:
        with Twins(load_as(name, "python"), load_as(name, kind)) as twins:
            drawn = Drawn(twins)
            for _, call in sequence:
                if call[0] != "setup" or kind != "native FMI 3":  # which has no such call
                    drawn.call(*call)
            for state in drawn.states:
                state.free()
            assert twins.call("Reset") == OK
            assert (twins.setup(), twins.enter(), twins.exit()) == (OK, OK, OK)
            for k in range(5):
                assert twins.step(k * 1e-3, 1e-3) == OK
                twins.outputs()
            assert twins.call("Terminate") == OK

    run()
