"""What every effect can do: be simulated and be inverted.

An effect acts in one of three ways, and overrides what it needs:

* on the core's parameters (`change_core`), e.g. fractional damping;
* as a linear time-invariant link (`transfer_function`, `pure_delay_s`), e.g. a low-pass: all
  links of an axis and its core form one composite response, simulated and inverted as one filter;
* on the samples after it (`simulate`, `invert`), e.g. an offset.
"""

from typing import ClassVar

import numpy as np

# Place in the signal's way through the sensor, from base to record.
MOUNTING, CORE, CONDITIONER, DELAY, GAIN, CROSS_AXIS, OFFSET = range(7)


class Effect:
    """Base of all effects; a subclass is a frozen dataclass of its parameters."""

    cause: ClassVar[str]
    stage: ClassVar[int]
    explanation: ClassVar[str]

    def pure_delay_s(self):
        """Time [s] by which this effect moves the signal as it is."""
        return 0.0

    def change_core(self, core):
        """Core as this effect leaves it."""
        return core

    def transfer_function(self, s):
        """Linear link's transfer function at complex `s` [rad/s], without its pure delay."""
        return np.ones_like(s, dtype=complex)

    def reference_gain(self):
        """Gain of the link on its plateau."""
        return 1.0

    def poles(self):
        """Poles of the link [rad/s]."""
        return np.array([])

    def zeros(self):
        """Zeros of the link [rad/s]."""
        return np.array([])

    @classmethod
    def simulate(cls, values, by_axis):
        """Samples after this effect.

        Parameters
        ----------
        values : ndarray, shape (n, 3)
            Samples before it.
        by_axis : dict of int to Effect
            The effect of this cause on each axis that has it.

        Returns
        -------
        ndarray, shape (n, 3)
        """
        return values

    @classmethod
    def invert(cls, values, by_axis):
        """Samples before this effect, from those after it; the inverse of `simulate`."""
        return values
