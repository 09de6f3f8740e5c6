"""A system as an environment of gymnasium: its rules, names and ranges, episodes, seeds."""

import numpy as np
import pytest
from grasp_cosim import InputError, System, simulate
from grasp_cosim.grasp.presets import SYSTEM
from support.native_fmus import needs_gcc

pytestmark = needs_gcc

pytest.importorskip("gymnasium")

from grasp_cosim.gym import Environment  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402 - if it is there
from gymnasium.vector import SyncVectorEnv  # noqa: E402

GAPS = {"plant.gap[1]": (-0.01, 0.2), "plant.gap[2]": (-0.01, 0.2)}
VISCOSITY = "controller.impact_reduction.viscosity[1]"


def environment(natives, **more):
    given = {
        "observations": GAPS, "actions": {VISCOSITY: (-0.5, 0.5)}, "reward": "plant.gap[1]",
        "step": 1e-3, "stop": 0.02,
        "start": lambda random: {"plant.object_width": random.uniform(0.05, 0.09)},
    }  # fmt: skip
    return Environment(System.load(SYSTEM, natives), **{**given, **more})


def test_gymnasium_takes_it(natives):
    made = environment(natives)
    check_env(made, skip_render_check=True)
    made.close()


def test_an_episode_is_a_run(natives):
    """Of which the reward and the observations are signals at the control steps."""
    made = environment(natives, start=None)
    actions = np.linspace(-0.5, 0.5, 20)
    for _ in range(2):
        seen, rewards, ends = [made.reset(options={"plant.object_width": 0.06})[0]], [], []
        for action in actions:
            observed, reward, *over, _ = made.step(np.array([action]))
            seen.append(observed)
            rewards.append(reward)
            ends.append(over)
        assert ends == [[False, False]] * 19 + [[False, True]]
        with simulate.session(
            System.load(SYSTEM, natives).with_values({"plant.object_width": 0.06}), stop=0.02
        ) as session:
            for action in actions:
                session.set(VISCOSITY, action)
                session.step(10)
            run = session.result()
        assert np.array(seen).tolist() == np.array([run[n][::10] for n in GAPS]).T.tolist()
        assert rewards == run["plant.gap[1]"][10::10].tolist()
    made.close()


def test_it_ends_where_it_is_told_to(natives):
    made = environment(natives, ends=lambda session: session.time > 0.0045)
    made.reset(seed=1)
    ends = [made.step(np.zeros(1))[2:4] for _ in range(5)]
    assert ends == [(False, False)] * 4 + [(True, False)]
    made.close()


def test_ranges_are_those_of_the_fmus(natives):
    made = environment(natives, observations=["plant.gap[1]"], actions=[VISCOSITY])
    variables = System.load(SYSTEM, natives).component("controller", "").interface.by_name
    declared = variables["impact_reduction.viscosity[1]"]
    assert made.action_space.low.tolist() == [declared.low]
    assert made.action_space.high.tolist() == [declared.high]
    made.close()
    for wrong, line in (
        ({"observations": ["plant.gab[1]"]}, "plant.gab"),
        ({"step": 1.5e-4}, r"step = 0\.00015: must be a whole number of 0\.0001 s"),
    ):
        with pytest.raises(InputError, match=line):
            environment(natives, **wrong)


def test_a_vector_of_them_draws_by_its_seed(natives):
    def rows(seed):
        made = SyncVectorEnv([lambda: environment(natives)] * 2)
        observed = [made.reset(seed=seed)[0]]
        for _ in range(45):  # over two episodes
            observed.append(made.step(np.zeros((2, 1)))[0])
        made.close()
        return np.array(observed)

    first = rows(3)
    assert (first == rows(3)).all()
    assert (first[0, 0] != first[0, 1]).any()
    assert (first[0] != rows(4)[0]).any()


WRONG = [
    ({"observations": "plant.gap[1]"}, "observations = 'plant.gap.1.': must be a list"),
    ({"observations": {"plant.gap[1]": 3}}, "observations: .*: must be ranges"),
    ({"actions": {VISCOSITY: (1.0, 0.0)}}, "actions: .* must be .least, greatest."),
    ({"reward": 3}, "reward = 3: must be a function"),
    ({"ends": True}, "ends = True: must be a function"),
    ({"step": "x"}, "step = 'x' s: must be a number"),
]


@pytest.mark.parametrize(("given", "said"), WRONG)
def test_what_is_no_environment_is_refused_at_once(natives, given, said):
    with pytest.raises(InputError, match=f"^{said}"):
        environment(natives, **given)


@pytest.mark.parametrize("action", [0.1, None, [0.1, 0.2]])
def test_an_action_has_the_shape_of_its_space(natives, action):
    made = environment(natives)
    made.reset()
    with pytest.raises(InputError, match=r"^action = .*: must be an array of 1$"):
        made.step(action)
    made.close()
