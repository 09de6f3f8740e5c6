from grasp_controller import adaptive
from grasp_fmus import slave


class GraspControllerAdaptive(slave.Fmi2Slave):
    """Multiple impedance control of a grasp whose two faces may differ in colour."""

    block = adaptive
