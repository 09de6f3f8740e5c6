"""The fixed-step master.

plan.py turns a system into a flat program, loop.py runs it, simulation.py is what users call.
Imports recording, realtime, fmi, system and what is below them.
"""
