"""A cause's parameters over one size."""

import dataclasses
from collections.abc import Callable

import numpy as np


@dataclasses.dataclass(frozen=True)
class Family:
    """Parameters of one cause over its size.

    Attributes
    ----------
    smallest, largest : float
        Physical bounds of the size.
    parameters : callable
        Size -> parameters.
    most : float
        Largest effect, as a share of the signal's RMS.
    """

    smallest: float
    largest: float
    parameters: Callable[[float], dict]
    most: float = 0.3


def excited_band(output, rate_hz):
    """Frequencies [Hz] below which 5 and 95 % of the output's power lie, without its mean."""
    power = np.cumsum(np.abs(np.fft.rfft(output - output.mean())) ** 2)
    low, high = np.searchsorted(power, [0.05 * power[-1], 0.95 * power[-1]])
    return low * rate_hz / len(output), high * rate_hz / len(output)
