from gripper_plant import rigid

from grasp_fmus import shipped


class GripperPlant(shipped.Script):
    """Two-finger gripper and a rigid, fixed object."""

    block = rigid
