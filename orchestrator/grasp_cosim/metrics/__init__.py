"""What a metric is: a function of recorded signals with a name, a unit and a description.

Imports errors and extensions only; which metrics there are is decided higher up.
"""
