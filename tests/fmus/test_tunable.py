"""Parameters that change between two steps: from there, the FMU is the block with the new ones."""

from math import isfinite

import pytest
from grasp_cosim.fmu_export.contract import build_params, declared, longest_step, packer, unpacker
from grasp_cosim.fmu_export.shipped import blocks
from hypothesis import HealthCheck, given
from hypothesis import strategies as st
from support.fmi2 import OK, Instance
from support.kinds import all_kinds
from support.marks import examples, slow

pytestmark = all_kinds

BLOCKS = blocks()
ELECTRONICS = ("ambient", "noise", "adc", "filter", "median")


def starts(name):
    """The fingers are about to touch, the sensor samples."""
    if "Controller" in name:
        return {"position[1]": 0.09, "velocity[1]": -0.1, "intensity[1]": 0.1}
    if name == "ProximitySensor":
        return {f"{stage}.enabled": True for stage in ELECTRONICS}
    at = {1: 0.0355, 2: 0.0355, 3: 0.0355} if "Hand" in name else {1: 0.0655, 2: -0.0055}
    forces = {k: -1.0 - 0.1 * k if x > 0.0 else 1.2 for k, x in at.items()}
    placed = {f"initial_position[{k}]": x for k, x in at.items()}
    if name == "TandemPlant":
        return placed | {"grip_force": -2.2, "wrist_command": 0.031, "wrist.delay": 0.003}
    return placed | {f"force[{k}]": force for k, force in forces.items()}


H = 2e-3


class Twin:
    """The block itself, called as its FMU is."""

    def __init__(self, block, start):
        self.block, self.fields = block, declared(block)
        names = [(n, f) for f in self.fields for n in f.names]
        starts = [s for f in self.fields for s in f.starts]
        self.values = {n: start.get(n, s) for (n, _), s in zip(names, starts, strict=True)}
        self.unpack = unpacker(self.fields)
        self.state = block.initial_state(self.params, self.inputs)

    @property
    def params(self):
        return build_params(self.block, self.fields, list(self.values.values()))

    @property
    def inputs(self):
        return packer(self.block.Inputs, self.fields)(list(self.values.values()))

    def outputs(self):
        """Those of now; ValueError where the parameters do not go together."""
        y = self.unpack(self.block.outputs(self.params, self.state, self.inputs))
        if not all(map(isfinite, y)):
            raise ArithmeticError
        return [value for value in y if not isinstance(value, bool)]

    def step(self, h):
        """ArithmeticError where it cannot, ValueError where the parameters do not go together."""
        p, before = self.params, self.state
        if h > longest_step(self.block):
            raise ArithmeticError
        self.state = self.block.step(p, self.state, self.inputs, h)
        try:
            self.outputs()
        except ArithmeticError:
            self.state = before
            raise


def expected(fmu, call):
    """The status that the FMU has, the result, and the end of the reason where it is refused."""
    try:
        return OK, call(), ""
    except ArithmeticError:
        return fmu.discarded, None, ""
    except ValueError as error:
        return fmu.refused, None, str(error)


def outputs(instance):
    """The status of asking for those that are numbers, and what they are."""
    fmu = instance.fmu
    names = [n for n in fmu.names("output") if n not in fmu.booleans]
    return instance.get_real([fmu.references[n] for n in names])


def values(f):
    """In the range of a parameter, mostly of the order of its start value."""
    low, high = f.limits or (-1e3, 1e3)
    if f.kind is bool:
        return st.booleans()
    if f.kind is int:
        return st.integers(int(low), int(high))
    size = abs(f.starts[0]) or 0.5
    near = st.sampled_from([-2.0, -0.5, 0.0, 0.1, 0.7, 1.0, 1.5, 4.0]).map(lambda x: x * size)
    # Of a size for which Python raises nothing: there C has a value
    drawn = st.floats(-10.0, 10.0).map(lambda x: float(f"{x * size:.6f}"))
    return (near | drawn).map(lambda x: min(max(x, low), high))


def changes(block):
    """Values of some tunable parameters, and how many steps follow; several times."""
    tunable = [(n, f) for f in declared(block) if f.variability == "tunable" for n in f.names]
    one = st.sampled_from(tunable).flatmap(lambda t: values(t[1]).map(lambda v: (t[0], v)))
    some = st.lists(one, min_size=1, max_size=4).map(dict)
    return st.lists(st.tuples(some, st.integers(0, 3)), min_size=1, max_size=6)


def agree(instance, twin, status, call):
    """A call ended as the block's does, for the same reason; and the outputs are the block's."""
    asked, _, reason = expected(instance.fmu, call)
    assert status == asked, instance.log
    if status != OK:
        assert reason in instance.log[0].text
        assert "\n" not in instance.log[0].text
    instance.log.clear()
    status, y = outputs(instance)
    asked, found, reason = expected(instance.fmu, twin.outputs)
    if asked == OK:
        assert (status, [*map(repr, y)]) == (OK, [*map(repr, found)])
    else:
        assert status == instance.fmu.refused
        assert reason in instance.log[0].text
    instance.log.clear()


@pytest.mark.hypothesis
@pytest.mark.parametrize("name", [slow(n) if n == "HandPlantMovable" else n for n in BLOCKS])
def test_a_change_is_that_of_the_block(load, name):
    """Whatever changes, between whichever steps."""
    fmu, block, start = load(name), BLOCKS[name], starts(name)

    @given(drawn=changes(block))
    @examples(25, suppress_health_check=list(HealthCheck))
    def run(drawn):
        twin, time = Twin(block, start), 0.0
        with Instance(fmu).initialise(**start) as instance:
            for change, steps in [({}, 2), *drawn]:
                assert instance.assign(change) == OK
                twin.values.update(change)
                agree(instance, twin, OK, lambda: None)
                for _ in range(steps):
                    status = instance.step(time, H)
                    agree(instance, twin, status, lambda: twin.step(H))
                    time += H if status == OK else 0.0

    run()


def test_what_does_not_go_together_is_refused_when_it_is_needed(load):
    """So that a host may set them in two calls; nothing has happened, and a set mends it."""
    with Instance(load("ProximitySensor"), "eye").initialise() as instance:
        assert instance.step(0.0, H) == OK
        before = instance.outputs()
        assert instance.assign({"adc.range[1]": 10.0, "reflectance": 0.5}) == OK
        refusal = "eye, t = 0.002 s: adc.range = 10.0, 10.0 V: the second must be above the first"
        state = instance.state()
        for step in (True, False):
            status = instance.step(H, H) if step else instance.get_real([1])[0]
            assert status == instance.fmu.refused
            assert [said.text for said in instance.log] == [refusal]
            instance.log.clear()
        assert instance.get("reflectance") == [0.5]
        saved = state.to_bytes()
        assert instance.restore(state) == OK
        state.free()
        assert instance.assign({"adc.range[1]": -10.0}) == OK
        assert instance.step(H, H) == OK
        assert instance.outputs() == [0.5 * value for value in before]
        status, again = instance.from_bytes(saved)  # of the moment with both
        assert (status, instance.restore(again)) == (OK, OK)
        assert instance.step(H, H) == instance.fmu.refused
        again.free()
