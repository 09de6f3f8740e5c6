"""Listeners that keep a run while it goes on, and the result, which is plain data.

Memory, CSV, MDF 4, the energy of the exchange; a result is the same when it is read back.
Imports metrics, realtime, system and what is below them.
"""
