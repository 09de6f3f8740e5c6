"""The qualification of an FMU that is to take the place of another.

What it declares otherwise, then each signal and metric of the closed loop in a tolerance band.
Imports master, metrics, interface and what is below them.
"""
