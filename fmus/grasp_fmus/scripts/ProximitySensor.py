from proximity_sensor import channel

from grasp_fmus import slave


class ProximitySensor(slave.Fmi2Slave):
    """Optical proximity sensor of the reflected-light-intensity type, one channel."""

    block = channel
