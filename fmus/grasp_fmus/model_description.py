"""What description.py has, for those that still look for it here."""

from .description import UNITS, Description, Experiment, Unit, model_description, version

__all__ = ["UNITS", "Description", "Experiment", "Unit", "model_description", "version"]
