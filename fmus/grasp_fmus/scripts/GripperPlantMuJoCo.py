from gripper_plant import mujoco_box

from grasp_fmus import slave


class GripperPlantMuJoCo(slave.Fmi2Slave):
    """Two-finger gripper and a box, fixed or on a floor, in MuJoCo."""

    block = mujoco_box
    requires = ("mujoco",)
