"""What the uncertainty of a model's parameters means for its response and for corrected signals."""

from .corrected import CorrectedUncertainty, corrected_uncertainty
from .parameters import UncertainAxis
from .response import ResponseUncertainty, response_uncertainty

__all__ = ["CorrectedUncertainty", "ResponseUncertainty", "UncertainAxis",
           "corrected_uncertainty", "response_uncertainty"]
