from grasp_controller import series
from grasp_fmus.slave import Fmi2Slave


class GraspController(Fmi2Slave):
    """Multiple impedance control: simultaneous contact, impact reduction, contact force."""

    block = series
