"""Sample by sample: the corrector and the simulator of running streams, and what watches them."""

from .corrector import Corrector
from .stream import Filtered

__all__ = ["Corrector", "Filtered"]
