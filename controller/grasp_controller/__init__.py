"""Multiple impedance control of a two-finger gripper. Card: controller/README.md."""
