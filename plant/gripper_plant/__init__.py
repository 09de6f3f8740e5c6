"""The gripper-object plant. Card: plant/README.md."""
