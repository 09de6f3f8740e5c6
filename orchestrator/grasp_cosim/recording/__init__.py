"""Listeners that keep a run while it goes on, and the result, which is plain data.

Memory, CSV, Arrow, MDF 4; a result is the same when it is read back.
"""
