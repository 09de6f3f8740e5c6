"""The interface of an FMU: the one typed reader of a model description, and units.

FMI 1.0 to 3.0; every variable, enumeration and unit in the package is one of these.
"""
