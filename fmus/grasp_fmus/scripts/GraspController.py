from grasp_controller import series

# pythonfmu's loader looks for a class that derives from the name Fmi2Slave.
from grasp_fmus.slave import BlockSlave as Fmi2Slave


class GraspController(Fmi2Slave):
    """Multiple impedance control: simultaneous contact, impact reduction, contact force."""

    block = series
