"""A sensor's model: its file, its parameters, its core and the effects around it."""

from .file import AXES, SCHEMA, AxisModel, SensorModel, is_link

__all__ = ["AXES", "SCHEMA", "AxisModel", "SensorModel", "is_link"]
