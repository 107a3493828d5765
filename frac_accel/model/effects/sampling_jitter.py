"""Instants of sampling that scatter."""

import dataclasses
from itertools import chain

import numpy as np

from ..parameters import parameter
from .base import STAMPS, Effect, Reading
from .residual_power import follows, law_likelihood, likelihood, slope_of, variance_law

# Standard deviations by which the residual's power must follow the slope's, the logarithm of the
# likelihood by which the slope must beat any other measure of the motion, and the share of the
# residual's power that must be due to it, and may be: far more than all of it is another law.
_SIGNIFICANT = 8.0
_BETTER = 12.0
_SHARE, _ALL = 0.05, 1.25
# Periods of the motion over which its power is averaged: what follows that as well as the slope at
# each instant is noise that grows with the motion.
_PERIODS = (1, 4, 16)
# Share of what the slope alone says of the error's power that is left at least by the next order.
_STILL = 0.1
# Share of the scatter by which it may be open.
_OPEN_BY = 0.5
# Share of samples that repeat the one before while the signal moves on, from which they are what
# scatters.
_REPEATED = 0.01
# Share of a filter's largest coefficient from which it lets through what stands in for a sample
# beside, and of the samples that is left at least without those.
_LETS_THROUGH, _KEPT = 0.05, 0.5
# Correlation of one sample's shift with the next, above which the instants wander and do not
# scatter.
_INDEPENDENT = 0.2


@dataclasses.dataclass(frozen=True)
class SamplingJitter(Effect):
    """The instants of sampling scatter, the stamps do not.

    No value can be put right, as its instant is not known; what it is worth depends on the slope.
    """

    cause = "sampling_jitter"
    read_off = True
    goes_with_size = True
    stage = STAMPS
    explanation = ("The instants of sampling scatter although the stamps do not: the error grows "
                   "with the slope of the signal.")
    experiment = ("Excite with one high frequency and with one low frequency of the same "
                  "amplitude: the error of scattering instants grows with the frequency.")

    rms_s: float = parameter("s", minimum=0, maximum=10, null=0.0)

    @classmethod
    def recognised(cls, seen, shown):
        """The residual's power is noise and J**2 times the slope's, sample by sample."""
        from scipy.signal import oaconvolve  # here, as the corrector needs nothing of it
        around = seen.of_one_error
        if seen.found.jitter_rms_s or around is None:
            return None  # stamps that scatter do the same, and so do values between samples
        if seen.repeated > _REPEATED:
            return None
        rate = seen.record.sampling_rate_hz
        used = seen.used & ~_bridged_beside(seen, around) if len(around) > 1 else seen.used
        if used.sum() < _KEPT * seen.used.sum():
            return None
        slope = slope_of(seen.output)
        error = _without_delay((seen.measured - seen.output)[used], slope[used])
        bend = slope_of(slope)
        level = seen.output - seen.output[used].mean()

        def of_errors(power):
            return oaconvolve(power, around**2, "same")[used]
        of_slope = of_errors(slope**2)
        noise, factor, std = variance_law(error, of_slope)
        if seen.is_coarse:
            # what rounding makes of a small signal follows its slope as well
            factor -= max(variance_law(seen.rounding()[used], of_slope)[1], 0.0)
        share = factor * of_slope.mean() / np.mean(error**2)
        if factor < _SIGNIFICANT * std or not _SHARE < share < _ALL:
            return None
        own = likelihood(error, noise + factor * of_slope)
        of_level = of_errors(level**2)
        others = chain([of_level], map(of_errors, _other_powers(level, slope, bend, used)))
        if any(own - law_likelihood(error, square) < _BETTER for square in others):
            return None
        # of the next order: a normal shift to the power of four is three times its variance's
        # square on average
        both = np.maximum(of_slope + factor * of_errors(0.75 * bend**2 + slope * slope_of(bend)),
                          _STILL * of_slope)
        noise, factor, std = variance_law(error, both)
        power = noise + factor * both
        if not all(follows(error, power, square) for square in (of_slope, of_level)):
            return None
        shift = error * slope[used] / power
        alike = np.correlate(around, around, "full")[len(around):] / (around @ around)
        if any(abs(np.corrcoef(shift[lag:], shift[:-lag])[0, 1]) > _INDEPENDENT + abs(own)
               for lag, own in zip((1, 2, 3), np.r_[alike, np.zeros(3)])):
            return None
        # what is faster than what is compared has instants that scatter, too
        known = of_slope.mean() / np.sum(around**2)
        less = known / (known + seen.slope_beyond(np.mean(error**2)))
        rms = float(np.sqrt(less * factor))
        # the sum of all errors says it, too: by as much as it says otherwise the law may be wrong
        other = np.sqrt(less * max(np.mean(error**2) - noise, 0.0) / both.mean())
        uncertain = np.sqrt((less * std / (2 * rms))**2 + ((1 - less) * rms / 4)**2
                            + (rms - other)**2)
        if uncertain > _OPEN_BY * rms:
            return None
        after = error * np.sqrt(noise / power)
        return cls(rms / rate), Reading(
            {"rms_s": float(uncertain / rate)}, error, after,
            f"the error's power follows the square of the slope: {share:.0%} of it, "
            f"{factor / std:.3g} standard deviations from none")


def _bridged_beside(seen, around):
    """Samples, a mask, whose values hold what stands in for others that say nothing: the filter to
    the band that is compared lets it through, and it is off where the motion is fast."""
    from scipy.ndimage import binary_dilation
    reach = int(np.flatnonzero(np.abs(around) > _LETS_THROUGH * np.abs(around).max())[-1]
                - len(around) // 2)
    silent = seen.rows & ~seen.used
    return binary_dilation(silent, iterations=reach) if reach and silent.any() else silent


def _without_delay(error, slope):
    """An error less what a constant delay and a clock that is off make of it, too small to have
    been found: that follows the slope's sign as well."""
    off = np.stack([slope, slope * np.linspace(-1, 1, len(slope))], axis=1)
    return error - off @ np.linalg.lstsq(off, error, rcond=None)[0]


def _other_powers(level, slope, bend, used):
    """What else noise may grow with than the motion's level: the power of its bend at each instant,
    and of all three over some of its periods."""
    from scipy.ndimage import uniform_filter1d
    yield bend**2
    period = 2 * np.pi * np.sqrt(np.mean(slope[used]**2) / max(np.mean(bend[used]**2), 1e-300))
    for periods in _PERIODS:
        length = min(max(int(periods * period), 1), len(level))
        for values in (slope, level, bend):
            yield uniform_filter1d(values**2, length)
