from gripper_plant import movable

from grasp_fmus import slave


class GripperPlantMovable(slave.Fmi2Slave):
    """Two-finger gripper and a box on a floor, which slides and topples."""

    block = movable
