"""A ROS 2 node for any FMU, or for a system of FMUs without one component."""
