"""A hand of several fingers that close along rays from its wrist, on top of the grasp."""
