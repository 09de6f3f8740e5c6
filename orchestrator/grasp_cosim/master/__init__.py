"""The fixed-step master.

plan.py turns a system into a flat program, loop.py runs it, simulation.py is what users call.
"""
