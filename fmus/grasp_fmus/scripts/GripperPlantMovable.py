from gripper_plant import movable

from grasp_fmus import shipped


class GripperPlantMovable(shipped.Script):
    """Two-finger gripper and a box on a floor, which slides and topples."""

    block = movable
