"""Tuning: the gains of a system that make one metric least, within limits on others.

What is tuned, the search, and its result in words. Of any system; imports sweep and what is below.
"""
