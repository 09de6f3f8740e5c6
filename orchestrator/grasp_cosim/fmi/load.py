"""From a component to its instance."""

from ..system.parts import Component
from .fmi2 import FmuInstance
from .instance import Instance


def load(component: Component) -> Instance:
    """The instance of a component; InputError where its FMU does not load."""
    return FmuInstance(component.name, component.interface)
