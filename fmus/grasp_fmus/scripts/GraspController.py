from grasp_controller import series
from grasp_fmus import shipped


class GraspController(shipped.Script):
    """Multiple impedance control: simultaneous contact, impact reduction, contact force."""

    block = series
