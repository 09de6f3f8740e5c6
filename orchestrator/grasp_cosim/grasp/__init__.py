"""The grasp of the paper on top of the co-simulation core.

The built-in system, its presets, metrics, pictures and scene, the studies, the paper's figures.
"""
