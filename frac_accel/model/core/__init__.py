"""Linear cores of a sensor model.

A core is a frozen dataclass with ``type`` (its name in a model file),
``transfer_function(s)``, ``poles()``, ``zeros()`` and ``require_stable()``.
"""

from .arx import Arx
from .fractional_transfer_function import FractionalTransferFunction
from .gain import Gain
from .oscillator import Oscillator

CORES = {core.type: core for core in (Oscillator, Arx, FractionalTransferFunction, Gain)}

__all__ = ["CORES", "Arx", "FractionalTransferFunction", "Gain", "Oscillator"]
