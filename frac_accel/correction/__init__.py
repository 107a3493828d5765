"""Inverse filters and the streaming kernel that runs them."""

from .corrector import Corrector
from .design import FilterDesign, design_inverse, design_simulator
from .fitting import DesignedFilter
from .stream import Filtered

__all__ = ["Corrector", "DesignedFilter", "FilterDesign", "Filtered", "design_inverse",
           "design_simulator"]
