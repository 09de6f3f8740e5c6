from grasp_controller import adaptive
from grasp_fmus import shipped


class GraspControllerAdaptive(shipped.Script):
    """Multiple impedance control of a grasp whose two faces may differ in colour."""

    block = adaptive
