"""Causes that a record shows by itself: limits, lattice, stamps, bursts."""

import dataclasses

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import resample_poly

from ..model.effects import known_effects
from .finding import Finding
from .gain import certainty, gain
from .leftover import rounding_errors
from .words import gain_words

# Samples of a stretch, and share of a record for which it must move, so that the size of what is
# left can be compared with the motion's: not in a shock.
_STRETCH = 64
_LASTS = 0.1


@dataclasses.dataclass(frozen=True)
class Seen:
    """A record beside the best simulation of it, for causes that it shows by itself.

    Attributes
    ----------
    record : Record
    found : Integrity
    axis : int
        Column of the record's axis.
    measured, output : ndarray, shape (n,)
    rows, used : ndarray of bool, shape (n,)
        Samples that are there, and those of them that the fit counted.
    spikes : ndarray of bool, shape (n,)
        Samples that it did not count since they stand far out.
    is_coarse : bool
        Whether the values' lattice accounts for much of what is left.
    parts : dict of str to float
        Error budget of what is left: shares by part, where they are above zero for certain.
    """

    record: object
    found: object
    axis: int
    measured: np.ndarray
    output: np.ndarray
    rows: np.ndarray
    used: np.ndarray
    spikes: np.ndarray
    is_coarse: bool
    parts: dict

    def rounding(self):
        """Errors, shape (n,), that a coarse lattice leaves of noisy simulated values."""
        return next(rounding_errors((self.measured - self.output) * self.used, self.output,
                                    self.used, self.found.step))

    def at_stamps(self):
        """Samples of the sensor's topic with an instant, these instants, and the simulated output
        at the stamps that they carry."""
        stamps = self.record.topics[1].stamps_ns
        rate = self.record.sampling_rate_hz
        place = (stamps - self.record.start_ns) * 1e-9 * rate
        slot = np.round(place).astype(int)
        good = (slot >= 0) & (slot < len(self.output))
        fine = resample_poly(self.output, 4, 1)
        spline = CubicSpline(np.arange(len(fine)) / 4, fine)
        return good, slot[good], spline(np.clip(place[good] - self.record.lag_s * rate, 0,
                                                len(self.output) - 1))

    def as_recorded(self):
        """Values before they were resampled, the simulated output at their instants, and which of
        them lie where the fit counted samples."""
        if "sensor" not in self.record.resampled:
            return self.measured[self.rows], self.output[self.rows], self.used[self.rows]
        good, slot, output = self.at_stamps()
        there = self.rows[slot]
        values = self.record.topics[1].values[good, self.axis]
        return values[there], output[there], self.used[slot[there]]


def _moving_share(reference):
    """Share of a record for which the reference moves: its mean power's square over the mean square
    of the power, in stretches."""
    count = max(len(reference) // _STRETCH, 1)
    moving = (reference - reference.mean())[:count * _STRETCH].reshape(count, -1)
    power = np.mean(np.square(moving), axis=1)
    return float(power.mean()**2 / max(np.mean(power**2), 1e-300))


def read_off(engine, fitted, found, shown):
    """Findings that the record shows by itself: limits, lattice, stamps.

    Parameters
    ----------
    engine : Engine
    fitted : Fitted
    found : Integrity
    shown : dict of str to Effect
        What `of_record` found, by cause.
    """
    findings = []
    # what the size of a residual tells presumes that it is noise, or bursts of it
    is_noise = all(part == "bursts" for _, part in engine.structure(fitted)) \
        and _moving_share(engine.problem.record.reference[:, engine.problem.axis]) > _LASTS
    for cause, effect, reading in _readings(engine, fitted, found, shown):
        if cause not in shown and not is_noise:
            continue
        g = engine.held_out(fitted, cause) if cause in engine.search.base \
            else gain(reading.before, reading.after)
        if g.is_relevant or (reading.evident and g.matters):
            findings.append(Finding(effect, reading.std, certainty(g), [], [
                reading.evidence, *gain_words(cause, g, np.inf, [])], g))
    return findings


def drowned(engine, fitted, found):
    """Mask, shape (n,), of the samples in which something that the residual shows by itself drowns
    whatever else may be wrong; arguments as those of `read_off`."""
    masks = [reading.drowned for _, _, reading in
             _readings(engine, fitted, found, {}) if reading.drowned is not None]
    return np.any(masks, axis=0) if masks else np.zeros(len(engine.problem.record), bool)


def _readings(engine, fitted, found, shown):
    """(Cause, effect, `Reading`) of each that the record shows by itself."""
    p = engine.problem
    here = p.coherent
    record = p.part(here)
    rows = record.valid.copy()
    rows[:64] = rows[-64:] = False
    seen = Seen(record, found, p.axis, p.measured[here], fitted.output[here], rows,
                rows & p.used[here], rows & p.taken(engine.spikes)[here],
                engine.coarse_step(fitted) is not None,
                {entry["part"]: entry["share"] for entry in engine.budget(fitted).parts
                 if entry["ci95"][0] > 0})
    for cause, cls in known_effects().items():
        recognised = cls.recognised(seen, shown.get(cause)) if cls.read_off else None
        if recognised is not None:
            yield cause, *recognised
