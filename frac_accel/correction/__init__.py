"""Inverse filters and the streaming kernel that runs them."""

from .corrector import Corrector
from .design import DesignedFilter, FilterDesign, design_inverse, design_simulator
from .stream import Filtered

__all__ = ["Corrector", "DesignedFilter", "FilterDesign", "Filtered", "design_inverse",
           "design_simulator"]
