"""What the uncertainty of a model's parameters means for its response and for corrected signals."""

import importlib

# Loaded when first used: the corrector needs of all this the parameters alone.
_HOME = {
    "CorrectedUncertainty": "corrected",
    "corrected_uncertainty": "corrected",
    "ResponseUncertainty": "response",
    "response_uncertainty": "response",
    "UncertainAxis": "parameters",
    "UncertainFilter": "digital_filter",
}

__all__ = sorted(_HOME)


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
