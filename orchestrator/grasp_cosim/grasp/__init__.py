"""The grasp of the paper on top of the co-simulation core."""
