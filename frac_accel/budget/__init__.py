"""What a model leaves of a sensor's signal, parted by kind before any cause is named."""

from .division import PARTS, WORDS, Budget, Division, error_budget
from .noise import EstablishedNoise, established_noise, unaccounted
from .record import Left, left_by

__all__ = ["PARTS", "WORDS", "Budget", "Division", "EstablishedNoise", "Left", "error_budget",
           "established_noise", "left_by", "unaccounted"]
