from proximity_sensor import optics

from grasp_fmus.slave import Fmi2Slave


class ProximitySensor(Fmi2Slave):
    """Optical proximity sensor of the reflected-light-intensity type, one channel."""

    block = optics
