from gripper_plant import rigid

from grasp_fmus.slave import Fmi2Slave


class GripperPlant(Fmi2Slave):
    """Two-finger gripper and a rigid, fixed object."""

    block = rigid
