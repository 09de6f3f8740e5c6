from gripper_plant import compliant

from grasp_fmus import shipped


class GripperPlantCompliant(shipped.Script):
    """Two-finger gripper and a fixed object that gives."""

    block = compliant
