"""An FMU that Python runs and the native one, call by call: the same in all that a host can see.

Values, what is refused and why, and the bytes of states; whatever is called, with whatever.
"""

import pytest
from hypothesis import HealthCheck, given
from support.drawn_calls import SEQUENCES, Drawn
from support.fmi2 import OK, Instance, drive
from support.kinds import NAMES
from support.marks import examples
from support.twins import Twins

pytestmark = pytest.mark.kinds("native", "native FMI 3")


@pytest.mark.hypothesis
@pytest.mark.parametrize("name", NAMES)
def test_any_sequence_of_calls(load_as, kind, name):
    @given(sequence=SEQUENCES)
    @examples(100, suppress_health_check=list(HealthCheck))
    def run(sequence):
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


@pytest.mark.parametrize("name", NAMES)
def test_a_run_that_is_saved_in_one_goes_on_in_the_other(load_as, kind, name):
    """To and fro; with the bytes alone, in an instance that has had another life."""
    python, native = load_as(name, "python"), load_as(name, kind)
    with Instance(python).initialise() as alone:
        expected = drive(alone, 0, 400)
    seen = []
    saved = b""
    for k, fmu in enumerate((python, native, python, native)):
        with Instance(fmu, "another").initialise() as instance:
            if saved:
                drive(instance, 0, 7)
                status, state = instance.from_bytes(saved)
                assert (status, instance.restore(state)) == (OK, OK)
                state.free()
            seen += drive(instance, 100 * k, 100 * (k + 1))
            state = instance.state()
            saved = state.to_bytes()
            state.free()
    assert seen == expected
