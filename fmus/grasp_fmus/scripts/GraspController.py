from grasp_controller import series
from grasp_fmus import slave


class GraspController(slave.Fmi2Slave):
    """Multiple impedance control: simultaneous contact, impact reduction, contact force."""

    block = series
