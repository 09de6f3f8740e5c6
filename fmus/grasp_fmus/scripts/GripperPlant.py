from gripper_plant import rigid

from grasp_fmus import slave


class GripperPlant(slave.Fmi2Slave):
    """Two-finger gripper and a rigid, fixed object."""

    block = rigid
