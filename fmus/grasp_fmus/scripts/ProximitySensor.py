from proximity_sensor import channel

from grasp_fmus import shipped


class ProximitySensor(shipped.Script):
    """Optical proximity sensor of the reflected-light-intensity type, one channel."""

    block = channel
