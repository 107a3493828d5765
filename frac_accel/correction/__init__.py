"""Design of inverse filters, and how sure their output is."""

from .design import FilterDesign, design_inverse, design_simulator
from .fitting import DesignedFilter

__all__ = ["DesignedFilter", "FilterDesign", "design_inverse", "design_simulator"]
