"""The dependence of results on the communication step.

A run repeated over steps, and the limit to which metrics and signals of any system tend.
Imports master, metrics and what is below them.
"""
