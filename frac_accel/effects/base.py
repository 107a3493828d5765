"""What every effect can do: be simulated and be inverted.

An effect acts in one of these ways, and overrides what it needs:

* on the core's parameters (`change_core`), e.g. fractional damping;
* on the core's spring (`add_force`), e.g. cubic stiffness;
* as a linear time-invariant link (`transfer_function`, `pure_delay_s`), e.g. a low-pass: all
  links of an axis and its core form one composite response, simulated and inverted as one filter;
* on the sensor's clock (`clock_ratio`);
* on the samples after all that (`simulate`, `invert`), e.g. an offset; where the inverse depends
  on the samples before, `live` gives an object that remembers them.
"""

from typing import ClassVar, NamedTuple

import numpy as np

from ..core import Oscillator
from ..errors import ModelError

# Place in the signal's way through the sensor, from base to record.
(MOUNTING, CORE, CONDITIONER, DELAY, GAIN, CROSS_AXIS, OFFSET, DEAD_ZONE, INTERFERENCE, CLIPPING,
 QUANTIZATION, STAMPS) = range(12)


class Circumstances(NamedTuple):
    """When and how warm the samples were.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
        Time [s] since the record's start.
    temperature_c : ndarray, shape (n,), or None
        Temperature [°C]; None or NaN where it is not known.
    """

    time_s: np.ndarray
    temperature_c: np.ndarray


    @classmethod
    def at_rest(cls, n):
        """`n` samples at the record's start and at 25 °C."""
        return cls(np.zeros(n), np.full(n, 25.0))


class Effect:
    """Base of all effects; a subclass is a frozen dataclass of its parameters."""

    cause: ClassVar[str]
    stage: ClassVar[int]
    explanation: ClassVar[str]
    needs_temperature: ClassVar[bool] = False
    # what separates this cause from its rivals where a record cannot
    experiment: ClassVar[str] = "Repeat with a wider band, and at half and at twice the level."

    # True for what is read off a record's stamps and values, and never fitted
    read_off: ClassVar[bool] = False

    # Largest values of parameters that a diagnosis looks for, where others would not be this cause.
    sought: ClassVar[dict[str, float]] = {}

    # Relative changes of parameters for numerical derivatives, where the usual one is too large.
    steps: ClassVar[dict[str, float]] = {}

    @classmethod
    def starts(cls, view):
        """Where a fit of this cause to a record may begin.

        Parameters
        ----------
        view : diagnosis.search.View
            What the search knows so far.

        Returns
        -------
        list of Start
            Of `fit_starts`; none where the record cannot show this cause.
        """
        return []

    def pure_delay_s(self):
        """Time [s] by which this effect moves the signal as it is."""
        return 0.0

    def clock_ratio(self):
        """Time that passes while the stamps advance by one second."""
        return 1.0

    def change_core(self, core):
        """Core as this effect leaves it."""
        return core

    def add_force(self, force):
        """`StaticForce` of the core's spring as this effect leaves it."""
        return force

    def transfer_function(self, s):
        """Linear link's transfer function at complex `s` [rad/s], without its pure delay."""
        return np.ones_like(s, dtype=complex)

    def limits(self):
        """Lowest and highest value that can come out."""
        return -np.inf, np.inf

    def reference_gain(self):
        """Gain of the link on its plateau."""
        return 1.0

    def poles(self):
        """Poles of the link [rad/s]."""
        return np.array([])

    def zeros(self):
        """Zeros of the link [rad/s]."""
        return np.array([])

    def simulate(self, values, circumstances):
        """Samples of one axis after this effect.

        Parameters
        ----------
        values : ndarray, shape (n,)
            Samples before it.
        circumstances : Circumstances

        Returns
        -------
        ndarray, shape (n,)
        """
        return values

    def invert(self, values, variance, circumstances):
        """Samples before this effect and their variance; the inverse of `simulate`.

        Parameters
        ----------
        values, variance : ndarray, shape (n,)
            Samples after it, and the variance of their noise (0 where it is not known).
        circumstances : Circumstances

        Returns
        -------
        values, variance : ndarray, shape (n,)
        """
        return values, variance

    def live(self, sampling_rate_hz):
        """Object whose `invert` takes consecutive blocks of a stream at that rate."""
        return self

    @classmethod
    def simulate_axes(cls, values, by_axis, circumstances):
        """Samples of all axes after this cause.

        Parameters
        ----------
        values : ndarray, shape (n, 3)
            Samples before it.
        by_axis : dict of int to Effect
            The effect of this cause on each axis that has it.
        circumstances : Circumstances

        Returns
        -------
        ndarray, shape (n, 3)
        """
        result = values.copy()
        for axis, effect in by_axis.items():
            result[:, axis] = effect.simulate(values[:, axis], circumstances)
        return result

    @classmethod
    def invert_axes(cls, values, variance, by_axis, circumstances):
        """Samples of all axes before this cause and their variance, both (n, 3)."""
        values, variance = values.copy(), variance.copy()
        for axis, effect in by_axis.items():
            values[:, axis], variance[:, axis] = effect.invert(
                values[:, axis], variance[:, axis], circumstances)
        return values, variance


def require_oscillator(core, cause):
    """The core; raise ModelError where it is not an oscillator."""
    if not isinstance(core, Oscillator):
        raise ModelError(f"effects: {cause} given with a core of type {core.type}, expected an "
                         "oscillator")
    return core
