"""Studies: many runs of one system.

Designs, parallel and resumable runs, the folder of a study, Sobol indices.
Imports master, metrics, system and what is below them.
"""
