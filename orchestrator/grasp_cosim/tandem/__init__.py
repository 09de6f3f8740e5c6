"""A gripper whose fingers move in tandem on the wrist of an arm, on top of the grasp."""
