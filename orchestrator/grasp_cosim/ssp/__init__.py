"""SSP, System Structure and Parameterization: systems to archives of 1.0, archives to systems.

Imports recording, system, interface and the ground floor. lxml reads and writes the XML, with the
official schemas that FMPy brings along. The two libraries for SSP do not serve: fmpy.ssp (0.3.32)
drops suppressUnitConversion, inline parameter mappings, all mappings but the linear one and every
line number; pyssp_standard (0.9.1) drops the transformations of connections and the entries of the
mappings, and takes 0.3 s longer to import than this package.
"""
