from gripper_plant import compliant

from grasp_fmus import slave


class GripperPlantCompliant(slave.Fmi2Slave):
    """Two-finger gripper and a fixed object that gives."""

    block = compliant
