from gripper_plant import mujoco_box

from grasp_fmus import shipped


class GripperPlantMuJoCo(shipped.Script):
    """Two-finger gripper and a box, fixed or on a floor, in MuJoCo."""

    block = mujoco_box
    requires = ("mujoco",)
