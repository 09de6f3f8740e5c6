from gripper_plant import rigid

# pythonfmu's loader looks for a class that derives from the name Fmi2Slave.
from grasp_fmus.slave import BlockSlave as Fmi2Slave


class GripperPlant(Fmi2Slave):
    """Two-finger gripper and a rigid, fixed object."""

    block = rigid
