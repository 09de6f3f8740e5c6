"""Multiple impedance control of a two-finger gripper. Equations: controller/README.md."""
