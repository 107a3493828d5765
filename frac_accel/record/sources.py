"""What the Python functions take for a measured record: a bag, runs of samples, or arrays."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from ..errors import FracAccelError
from ..io.samples import Samples
from ..model import AXES


def is_bag(source: Any) -> bool:
    """Whether a source is the path of a bag."""
    return isinstance(source, (str, os.PathLike))


def temperature_of(source: Any, topic: str) -> tuple | None:
    """Stamps [ns] and temperatures [°C] of a bag's topic; None where it has none, or of no bag.

    Raises
    ------
    BagError
        If the bag or what it has of the topic cannot be read.
    """
    from ..io.bag import BagReader, read_temperature
    if not is_bag(source) or topic not in BagReader(source).topics:
        return None
    measured = read_temperature(source, topic)
    return measured.stamps_ns, measured.celsius


def samples_of(values: Any, sampling_rate_hz: float | None = None, axis: str = "x",
               name: str = "values") -> Samples:
    """Samples of a uniform array; samples are given back as they are.

    Parameters
    ----------
    values : Samples or array_like, shape (n,) or (n, 3)
        One column is motion along `axis`; the other two axes are then at rest.
    sampling_rate_hz : float, optional
        Needed by arrays.
    axis : {"x", "y", "z"}
    name : str
        What the values are, for messages.

    Raises
    ------
    FracAccelError
        If the rate is missing, the shape is another one, or a value is not finite.
    """
    if axis not in tuple(AXES):
        raise FracAccelError(f"axis: {axis!r} given, expected x, y or z")
    if isinstance(values, Samples):
        return values
    try:
        array = np.asarray(values, float)
    except (TypeError, ValueError):
        raise FracAccelError(f"{name}: no array of numbers, expected shape (n,) or (n, 3)") \
            from None
    if array.ndim not in (1, 2) or not len(array) or array.shape[1:] not in ((), (3,)):
        raise FracAccelError(f"{name}: shape {array.shape} given, expected (n,) or (n, 3)")
    if not np.isfinite(array).all():
        first = int(np.argwhere(~np.isfinite(array))[0][0])
        raise FracAccelError(f"{name}: sample {first} is not finite")
    if sampling_rate_hz is None:
        raise FracAccelError("sampling_rate_hz: missing, expected the rate of the arrays in Hz")
    try:
        rate = float(sampling_rate_hz)
    except (TypeError, ValueError):
        rate = np.nan
    if not (np.isfinite(rate) and rate > 0):
        raise FracAccelError(f"sampling_rate_hz: {sampling_rate_hz!r} given, expected above 0")
    if array.ndim == 1:
        column, array = array, np.zeros((len(array), 3))
        array[:, AXES.index(axis)] = column
    # one number that looks like as many as there are values
    unknown = np.broadcast_to(np.nan, array.shape)
    return Samples.of(np.round(np.arange(len(array)) * (1e9 / rate)).astype(np.int64), array,
                      unknown)


def pair_of(source: Any, sampling_rate_hz: float | None = None, axis: str = "x",
            reference: str | None = None, sensor: str | None = None) -> tuple[Samples, Samples]:
    """Samples of reference and sensor.

    Parameters
    ----------
    source : str, Path or tuple
        A bag, or reference and sensor as for `samples_of`.
    sampling_rate_hz : float, optional
        Needed by arrays.
    axis : {"x", "y", "z"}
    reference, sensor : str, optional
        Topics of a bag; by default those of the design.

    Raises
    ------
    FracAccelError
        As `samples_of`; or if the source is no pair, or two arrays are not as long.
    """
    if is_bag(source):
        from ..io.bag import RAW_TOPIC, REFERENCE_TOPIC, read_bag
        names = reference or REFERENCE_TOPIC, sensor or RAW_TOPIC
        topics = read_bag(source, list(names))
        return topics[names[0]], topics[names[1]]
    if not isinstance(source, (tuple, list)) or len(source) != 2:
        raise FracAccelError("source: expected a bag, or (reference, sensor)")
    one, other = (samples_of(values, sampling_rate_hz, axis, name)
                  for values, name in zip(source, ("reference", "sensor")))
    if not any(isinstance(part, Samples) for part in source) \
            and len(one.values) != len(other.values):
        raise FracAccelError(f"reference and sensor have {len(one.values)} and "
                             f"{len(other.values)} samples, expected as many")
    return one, other
