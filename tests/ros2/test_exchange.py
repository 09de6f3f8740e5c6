"""When a model steps, with which inputs, and what is published on a loss."""

from types import SimpleNamespace

import pytest
from grasp_cosim.interface.units import IDENTITY
from grasp_cosim_ros.exchange import Exchange, Phase
from grasp_cosim_ros.settings import Settings
from grasp_cosim_ros.topics import Entry, Topic, Topics

TOPICS = Topics(
    (Topic("in", "t", {"data": (Entry("u", IDENTITY, "Real"),)}),),
    (Topic("out", "t", {"data": (Entry("y", IDENTITY, "Real"),)}),),
    {"u": -1.0, "y": 7.0},
)


class Delay:
    """Tells the input of the last step."""

    def __init__(self, steps=1000):
        self.begun, self.inputs, self.y, self.steps = [], [], 0.0, steps

    def begin(self, inputs):
        self.begun.append(dict(inputs))
        self.y = inputs.get("u", 0.0)

    def advance(self, inputs):
        self.inputs.append(inputs.get("u"))
        self.y = inputs.get("u", self.y)
        self.steps -= 1
        return self.steps > 0

    def read(self, names):
        return dict.fromkeys(names, self.y)


@pytest.fixture
def made():
    def make(model=None, **settings):
        settings = Settings(fmu="a.fmu", topics="t.yaml", **{"misses_tolerated": 1} | settings)
        told, losses = [], []
        exchange = Exchange(
            model or Delay(), TOPICS, settings, lambda v: told.append(v["y"]), losses.append
        )
        return SimpleNamespace(exchange=exchange, told=told, losses=losses, model=exchange.model)

    return make


def test_the_first_sample_initialises_and_each_further_one_is_a_step(made):
    m = made()
    for value in (1.0, 2.0, 3.0):
        m.exchange.take("in", {"u": value}, 0)
    assert m.model.begun == [{"u": 1.0}]
    assert m.model.inputs == [2.0, 3.0]
    assert m.told == [1.0, 2.0, 3.0]


def test_the_one_that_begins_tells_its_outputs_before_a_sample(made):
    m = made(initiate=True)
    m.exchange.start()
    assert m.told == [0.0]
    m.exchange.take("in", {"u": 1.0}, 0)
    assert m.model.inputs == [1.0]


def test_a_step_without_a_sample_holds_the_values(made):
    m = made()
    m.exchange.take("in", {"u": 1.0}, 0)
    m.exchange.step(0)
    assert m.model.inputs == [1.0]
    assert m.losses == []


@pytest.mark.parametrize(
    ("on_loss", "inputs", "told"),
    [
        ("stop", [1.0], [1.0, 1.0]),
        ("hold", [1.0, None, None], [1.0, 1.0, 1.0, 1.0]),
        ("failsafe", [1.0, -1.0, -1.0], [1.0, 1.0, 7.0, 7.0]),
    ],
)
def test_a_loss_has_the_outputs_that_were_asked_for(made, on_loss, inputs, told):
    m = made(on_loss=on_loss)
    m.exchange.take("in", {"u": 1.0}, 0)
    m.exchange.step(0)  # the tolerated miss
    m.exchange.step(0)
    if on_loss != "stop":
        m.exchange.step(0)
    assert len(m.losses) == 1
    assert "no sample of in within 0.1 s, 2 steps in a row" in m.losses[0]
    assert m.exchange.phase is Phase.LOST
    assert m.model.inputs == inputs
    assert m.told == told


@pytest.mark.parametrize(("resume", "begun"), [(True, 2), (False, 1)])
def test_peers_that_are_back_make_the_model_begin_again_if_wanted(made, resume, begun):
    m = made(on_loss="failsafe", resume=resume, misses_tolerated=0)
    m.exchange.take("in", {"u": 1.0}, 0)
    m.exchange.step(0)
    m.exchange.take("in", {"u": 5.0}, 0)
    assert len(m.model.begun) == begun
    assert (m.exchange.phase is Phase.RUNNING) == resume


def test_by_the_clock_a_sample_begins_no_step(made):
    m = made(mode="clock", timeout=1.0)
    m.exchange.take("in", {"u": 1.0}, 0)
    m.exchange.take("in", {"u": 2.0}, 0)
    assert m.model.inputs == []
    m.exchange.step(10)
    assert m.model.inputs == [2.0]


def test_the_end_of_the_model_ends_the_exchange(made):
    m = made(model=Delay(steps=1))
    m.exchange.take("in", {"u": 1.0}, 0)
    m.exchange.take("in", {"u": 2.0}, 0)
    assert m.exchange.phase is Phase.ENDED
    m.exchange.take("in", {"u": 3.0}, 0)
    m.exchange.step(0)
    assert m.told == [1.0, 2.0]


def test_as_it_ends_the_outputs_are_safe(made):
    m = made()
    m.exchange.take("in", {"u": 1.0}, 0)
    assert m.exchange.failsafe() == {"y": 7.0}
