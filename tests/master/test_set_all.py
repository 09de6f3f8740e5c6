"""Several values at once: the bits, the log and the refusals of values one by one."""

import pytest
from grasp_cosim import InputError, simulate

VALUES = {
    "plant.force[1]": -0.5,
    "plant.force[2]": 0.25,
    "sensor_1.reflectance": 0.5,
    "sensor_1.spot.enabled": True,
    "plant.finger_mass[1]": 0.75,
}


def run(grasp, set_values):
    with simulate.session(grasp.without("controller"), step=1e-3, stop=0.02) as session:
        for number in range(20):
            changed = {n: v if v is True else v / (1 + number) for n, v in VALUES.items()}
            set_values(session, changed)
            session.step()
        return session.result()


def test_they_have_the_bits_and_the_log_of_values_one_by_one(grasp):
    def one_by_one(session, values):
        for name, value in values.items():
            session.set(name, value)

    first = run(grasp, one_by_one)
    second = run(grasp, lambda session, values: session.set_all(values))
    assert [*second.signals] == [*first.signals]
    assert all((second[name] == first[name]).all() for name in first.signals)
    assert sorted(second.log) == sorted(first.log)
    assert any("plant.force[2]" in line and "20 times" in line for line in second.log)


@pytest.mark.parametrize("before", [False, True])
def test_a_value_that_does_not_fit_is_refused_as_by_set(grasp, before):
    with simulate.session(grasp.without("controller"), step=1e-3, stop=0.1) as session:
        if before:
            session.set("plant.finger_mass[1]", 0.5)
        refusals = []
        for set_mass in (
            lambda: session.set("plant.finger_mass[1]", -1.0),
            lambda: session.set_all({"plant.force[1]": 1.0, "plant.finger_mass[1]": -1.0}),
        ):
            with pytest.raises(InputError) as caught:
                set_mass()
            refusals.append(str(caught.value))
        assert refusals[0] == refusals[1]
        assert session["plant.finger_mass[1]"] == 0.5


def test_a_reset_begins_without_them(grasp):
    with simulate.session(grasp.without("controller"), step=1e-3, stop=0.1) as session:
        session.set_all(VALUES)
        session.set_all(VALUES)
        session.step(3)
        session.reset()
        session.step(3)
        assert session["plant.velocity[1]"] == 0.0


def test_what_belongs_to_the_system_itself_is_passed_on(grasp, tmp_path):
    """An archive has its own inputs: a name of one stands for those behind it."""
    from grasp_cosim.system.parts import Link, Port, SystemInput

    system = grasp.without("controller")
    links = tuple(Link(Port("plant", f"force[{i}]")) for i in (1, 2))
    object.__setattr__(system, "inputs", {"push": SystemInput(links)})
    with simulate.session(system, step=1e-3, stop=0.1) as session:
        session.set_all({"push": -1.0})
        assert session["plant.force[1]"] == session["plant.force[2]"] == -1.0
