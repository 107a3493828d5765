"""Identify, simulate, correct and diagnose accelerometers."""

import importlib

# Names load what they need when they are first used: a node must not wait for the commands'
# libraries, nor a notebook for those of the bags.
_HOME = {
    "SensorModel": "model",
    "Effect": "model.effects.base",
    "check_effect": "effect_checks",
    "simulate": "simulation",
    "correct": "streaming.offline",
    "validate": "validation",
    "identify": "identification",
    "diagnose": "diagnosis",
    "design_inverse": "correction.design",
    "Corrector": "streaming.corrector",
    "LiveSimulator": "streaming.live_simulation",
    "error_metrics": "signals.metrics",
    "response_uncertainty": "uncertainty",
    "corrected_uncertainty": "uncertainty",
    "read_bag": "io.bag",
    "write_bag": "io.bag",
    "FracAccelError": "errors",
    "Samples": "io.samples",
    "Record": "record.record",
    "Orientation": "record.orientation",
}

__all__ = sorted(_HOME)  # and __version__


def __getattr__(name):
    if name == "__version__":
        from importlib.metadata import PackageNotFoundError, version
        try:
            return version("frac_accel")
        except PackageNotFoundError:
            return "not installed"
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__():
    return __all__
