"""GraspController with Eq. (5) as a quotient, which noise biases: docs/limits.md.

    f_p = D_p·(xi[k] - xi[k-1])/(h·xi[k])        instead of        D_p·(ln xi[k] - ln xi[k-1])/h

Another equation in one layer, and everything else as it comes with the package.
"""

from grasp_controller import impact_reduction as layer_2
from grasp_controller import series
from grasp_controller.series import Inputs, Params, State

initial_state = series.initial_state
outputs = series.outputs
Outputs = series.Outputs


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance by h seconds: the published controller, then layer 2 once more with another f_p."""
    after = series.step(p, x, u, h)
    xi_1, xi_2 = u.intensity
    was_1, was_2 = x.intensity
    d_1, d_2 = p.impact_reduction.viscosity
    floor = p.impact_reduction.intensity_floor
    f_p = (
        0.0 if xi_1 < floor or was_1 < floor else d_1 * (xi_1 - was_1) / (h * xi_1),
        0.0 if xi_2 < floor or was_2 < floor else d_2 * (xi_2 - was_2) / (h * xi_2),
    )
    virtual = after.virtual
    if p.impact_reduction.enabled:
        before = x.target if p.simultaneous_contact.enabled else after.target
        virtual = layer_2.advance(p.impact_reduction, x.virtual, before, after.target, f_p, h)
    return after._replace(virtual=virtual, impact_reduction_force=f_p)
