"""Measured records: from stamped samples to one axis system on uniform instants.

`Samples` are what a topic holds, a `Topic` is what can be said of one (clock, lattice, limits), and
a `Record` is a reference and a sensor together; everything else begins there.
"""

import importlib

# Loaded when first used.
_HOME = {"Record": "record", "Topic": "topic", "Temperature": "temperature",
         "Orientation": "orientation"}

__all__ = sorted(_HOME)


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
