"""The audit: each claim of the paper, what was computed, the verdict and the cause.

A claim is a function without arguments in one of the modules here; its verdict follows from what it
computes, so that it would be another one if the numbers were.
"""

from . import accuracy, identification, orders
from .claim import STATUSES, Claim

__all__ = ["STATUSES", "Claim", "audit"]

_MODULES = (identification, accuracy, orders)


def audit():
    """All claims, in the order of the paper's sections.

    Returns
    -------
    list of Claim
    """
    return [function() for module in _MODULES for function in module.CLAIMS]
