"""What a model leaves of a sensor's signal, parted by kind before any cause is named."""

from .division import PARTS, WORDS, Budget, Division, error_budget

__all__ = ["PARTS", "WORDS", "Budget", "Division", "error_budget"]
