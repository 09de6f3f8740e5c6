"""The gripper-object plant. Equations: plant/README.md."""
