"""Samples of the adaptive controller: any, and those of an approach by Eq. (9)."""

from itertools import pairwise

from grasp_controller import adaptive, series
from grasp_controller.adaptive import Inputs
from hypothesis import strategies as st

Pair = tuple[float, float]

N, K, L_0 = 1.1506, 0.0024, 0.005
"""Exponent, gain in V.m^n and offset in m of the published sensors."""


H = 1e-2
"""s, the step of an approach."""


def intensity(gap, alpha, n=N):
    """Eq. (9), V; K is the same at 100 mm for every n."""
    return float(alpha * K * 0.1 ** (n - N) / (gap + L_0) ** n)


def approach(alpha, gaps=(0.08, 0.08), end=5e-3, count=100, n=N):
    """Both fingers from their gaps in m to the gap `end`, evenly in steps of H; faces at 35 mm."""
    v_1, v_2 = ((gap - end) / (count * H) for gap in gaps)
    samples = []
    for k in range(count + 1):
        l_1, l_2 = (gap + (end - gap) * k / count for gap in gaps)
        seen = (intensity(l_1, alpha[0], n), intensity(l_2, alpha[1], n))
        samples.append(Inputs((0.035 + l_1, -0.035 - l_2), (-v_1, v_2), seen))
    return samples


def relit(u, right, left):
    """A sample with other intensities."""
    xi_1, xi_2 = u.intensity
    return u._replace(intensity=(right(xi_1), left(xi_2)))


def run(p, samples, h=H):
    """From the first sample on, the state and outputs at each."""
    x = adaptive.initial_state(p, samples[0])
    trace = [(x, adaptive.outputs(p, x, samples[0]))]
    for _, u in pairwise(samples):
        x = adaptive.step(p, x, u, h)
        trace.append((x, adaptive.outputs(p, x, u)))
    return trace


def published(p, samples, h=H):
    """The outputs at each sample of the published law with the same layers."""
    three = series.Params(p.simultaneous_contact, p.impact_reduction, p.contact_force)
    x = series.initial_state(three, samples[0])
    trace = [series.outputs(three, x, samples[0])]
    for u in samples[1:]:
        x = series.step(three, x, u, h)
        trace.append(series.outputs(three, x, u))
    return trace


def swapped(pair):
    """A signal of both fingers, seen from behind the gripper."""
    first, second = pair
    return -second, -first


def mirrored(u):
    """What is measured from behind the gripper."""
    return Inputs(swapped(u.position), swapped(u.velocity), u.intensity[::-1])


def assert_mirrored(y, z):
    """The one is exactly the other from behind the gripper, in all that both laws put out."""
    assert z.force == swapped(y.force)
    assert z.target_position == -y.target_position
    assert z.virtual_position == swapped(y.virtual_position)
    assert z.simultaneous_contact_force == -y.simultaneous_contact_force
    assert z.impact_reduction_force == swapped(y.impact_reduction_force)


def numbers(values):
    """All numbers of samples or of outputs."""
    if isinstance(values, tuple):
        return [x for value in values for x in numbers(value)]
    return [values]


def pairs(low, high):
    """Two numbers of a range."""
    return st.tuples(st.floats(low, high), st.floats(low, high))


ANY_SAMPLES = st.lists(
    st.builds(Inputs, pairs(-0.2, 0.2), pairs(-1.0, 1.0), pairs(0.0, 2.0)), min_size=2, max_size=20
)
"""Of a gripper, in any order."""
