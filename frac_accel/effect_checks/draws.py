"""Random parameters of a cause, and the sensor and motion on which it is tried."""

import dataclasses

import numpy as np

from ..errors import ModelError
from ..model import AxisModel, SensorModel
from ..model.core import Gain, Oscillator
from ..model.effects.base import Circumstances
from ..model.parameters import Scales, as_mapping, build, is_varied, parameter_fields

RATE = 1000.0  # [Hz]
# In band for the whole test sensor, and clear of the Nyquist frequency [shares of the rate].
BAND = 0.01, 0.1
CORE = Oscillator(natural_frequency_hz=0.25 * RATE, damping_ratio=0.4, sensitivity=1.0)
# Level, rate and duration by which parameters are scaled; no record here is longer.
_SCALES = Scales(1.0, RATE, 8.0)
# Draws that the class itself may refuse before its declared ranges count as wrong.
_TRIES = 100


class Broken(Exception):
    """A promise that a cause does not keep, in words."""


class Draws:
    """Seeded draws of effects and records.

    Parameters
    ----------
    seed : int or sequence of int
    """

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)

    def usual(self, cls):
        """Effect with parameters as large as a fit takes for a change of one."""
        return self._accepted(cls, self._usual)

    def any(self, cls):
        """Effect with parameters from all of their declared ranges, clamped to `reach`."""
        return self._accepted(cls, self._any)

    def _accepted(self, cls, value):
        for _ in range(_TRIES):
            drawn = {field.name: float(value(field)) if is_varied(field) else self._fixed(field)
                     for field in parameter_fields(cls) if not field.metadata.get("list")}
            try:
                return build(cls, drawn, cls.cause)
            except ModelError as error:
                refusal = error
        raise Broken(f"none of {_TRIES} draws from the declared ranges is accepted: {refusal}")

    def _fixed(self, field):
        """A count, a word or what no fit varies."""
        if field.metadata.get("fixed"):
            return field.default if field.default is not dataclasses.MISSING \
                else min(1.0, float(np.mean(span(field))))
        if field.metadata.get("choices"):
            return str(self.rng.choice(field.metadata["choices"]))
        low, high = span(field)
        return int(self.rng.integers(np.ceil(low), np.floor(min(high, low + 10)) + 1))

    def _usual(self, field):
        if field.metadata["null"] == "core":
            return getattr(CORE, field.name) * self.rng.uniform(0.75, 1.3)
        low, high = span(field)
        if low > 0:
            scale = scale_of(field)
            return np.clip(scale * np.exp(self.rng.uniform(*np.log([0.02, 3.0]))), low, high)
        # near zero nothing could be seen, and far beyond one most causes destroy the signal
        size = scale_of(field) * self.rng.uniform(0.2, 1.0)
        sign = self.rng.choice([-1.0, 1.0]) if low < 0 < high else np.sign(low + high)
        return np.clip(sign * size, low, high)

    def _any(self, field):
        low, high = span(field)
        if self.rng.random() < 0.1:
            return self.rng.choice([low, high])
        if low > 0:
            return np.exp(self.rng.uniform(np.log(low), np.log(high)))
        return self.rng.uniform(low, high)

    def values(self, n):
        """Samples of three axes, shape (n, 3), of a level of one, with large and small ones."""
        return self.rng.normal(size=(n, 3)) * self.rng.choice([0.1, 1.0], (n, 1))

    def motion(self, n, low=BAND[0]):
        """Band-limited acceleration of three axes, shape (n, 3), from rest to rest; RMS 1."""
        spectrum = self.rng.normal(size=(n // 2 + 1, 3, 2)) @ np.array([1, 1j])
        frequency = np.fft.rfftfreq(n)
        spectrum[(frequency < low) | (frequency > BAND[1])] = 0
        values = np.fft.irfft(spectrum, n, axis=0) * np.hanning(n)[:, None]
        return values / np.std(values, axis=0)

    def circumstances(self, n):
        """Times from the record's start, and temperatures that wander between 5 and 45 °C."""
        time = np.arange(n) / RATE
        return Circumstances(time, 25 + 20 * np.sin(3 * time + self.rng.uniform(0, 6)))

    def cuts(self, n):
        """Ends of consecutive blocks of `n` samples: single samples, a few, and many."""
        sizes = self.rng.choice([1, 1, 2, 7, 61], n)
        inner = np.cumsum(sizes)
        return [0, *inner[inner < n].tolist(), n]


def scale_of(field):
    """Change of a parameter that counts as one, for signals of a level of one."""
    return _SCALES.of(field, field.metadata["null"]
                                     if isinstance(field.metadata["null"], float)
                                     and np.isfinite(field.metadata["null"]) else 0.0)


def span(field):
    """Smallest and largest value of a parameter that is tried."""
    limits, scale = field.metadata, scale_of(field)
    low = next((limits[k] for k in ("above", "minimum") if limits[k] is not None), -1e3 * scale)
    high = next((limits[k] for k in ("below", "maximum") if limits[k] is not None), 1e3 * scale)
    if limits["reach"] is not None or (limits["above"] == 0 and limits["below"] is None):
        least, most = _SCALES.reach(field, scale)
        low, high = max(low, least), min(high, most) if limits["below"] or limits["maximum"] \
            else most
    # the open ends themselves are not allowed
    inside = 1e-6 * (high - low)
    return (low + inside if limits["above"] == low else low,
            high - inside if limits["below"] == high else high)


def core_for(effect):
    """Core of the test sensor: an oscillator, or a gain for what needs a flat one."""
    return CORE if effect.acts_on(CORE) else Gain(CORE.sensitivity)


def sensor_with(*effects):
    """The test sensor with these effects on its x axis, and none on the others."""
    core = next((core_for(effect) for effect in effects if not effect.acts_on(CORE)), CORE)
    return SensorModel(core, axes={"x": AxisModel(core, effects)})


def words(effect):
    """An effect's parameters, for a message."""
    return ", ".join(f"{name} {value:.6g}" for name, value in as_mapping(effect).items())
