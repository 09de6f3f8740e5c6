"""Pages and pictures of any result, study or qualification.

What shows a grasp comes from higher up, as a scene and as its own pictures.
"""
