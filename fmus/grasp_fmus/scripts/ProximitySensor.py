from proximity_sensor import optics

# pythonfmu's loader looks for a class that derives from the name Fmi2Slave.
from grasp_fmus.slave import BlockSlave as Fmi2Slave


class ProximitySensor(Fmi2Slave):
    """Optical proximity sensor of the reflected-light-intensity type, one channel."""

    block = optics
