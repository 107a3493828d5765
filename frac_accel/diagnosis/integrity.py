"""What the record itself says, before any physics: stamps, lattice of values, limits, axes."""

import dataclasses

import numpy as np

from ..pair import clean, slots_of

# Samples at the extreme value, and their number against the next value's, that are a pile-up.
_PILE = 5
_PILE_RATIO = 4
# Scatter of the stamps [sampling intervals] below which it counts as none.
_JITTER = 2e-4
_LATTICE_SAMPLES = 20_000


@dataclasses.dataclass(frozen=True)
class Integrity:
    """Findings about the data.

    Attributes
    ----------
    samples : int
        Usable samples of the sensor.
    missing : int
        Instants of the sensor's clock without a sample.
    duplicates, stamps_back, not_finite : int
        Samples that were left out for it.
    jitter_rms_s : float
        Scatter of the sensor's stamps about a uniform clock.
    step : float or None
        Distance of the values' lattice [output units].
    lower, upper : float or None
        Limits at which samples pile up.
    words : list of str
    """

    samples: int
    missing: int
    duplicates: int
    stamps_back: int
    not_finite: int
    jitter_rms_s: float
    step: float | None
    lower: float | None
    upper: float | None
    words: list

    @property
    def dropped_fraction(self):
        """Share of the instants without a sample."""
        return self.missing / (self.samples + self.missing)


def check(sensor, sampling_rate_hz, column):
    """Integrity of the sensor's samples.

    Parameters
    ----------
    sensor : Samples
    sampling_rate_hz : float
    column : int
        Axis whose values are looked at.
    """
    stamps, values = clean(sensor)
    finite = np.isfinite(sensor.values).all(axis=1)
    steps = np.diff(sensor.stamps_ns[finite])
    duplicates = int(np.sum(steps == 0))
    back = len(sensor.stamps_ns) - len(stamps) - duplicates - int(np.sum(~finite))
    seconds = (stamps - stamps[0]) * 1e-9
    slot = slots_of(seconds * sampling_rate_hz)
    slope, start = np.polyfit(slot, seconds, 1)
    scatter = seconds - (slope * slot + start)
    jitter = float(np.std(scatter))
    # a message whose value is no number has come all the same
    useless = np.round((sensor.stamps_ns[~finite] - stamps[0]) * 1e-9 * sampling_rate_hz)
    useless = useless[(useless > slot[0]) & (useless < slot[-1])]
    missing = int(slot[-1] - slot[0] + 1 - len(np.union1d(slot, useless)))
    axis = values[:, column]
    step = lattice(axis)
    lower, upper = pile_up(-axis, step), pile_up(axis, step)
    words = []
    if missing:
        words.append(f"{missing} of {len(slot) + missing} samples are missing "
                     f"({missing / (len(slot) + missing):.2%})")
    for number, what in ((duplicates, "repeat a stamp"), (max(back, 0), "have a stamp that goes "
                         "back"), (int(np.sum(~finite)), "are not finite")):
        if number:
            words.append(f"{number} samples {what} and are left out")
    if jitter * sampling_rate_hz > _JITTER:
        words.append(f"the stamps scatter by {jitter:.3g} s (RMS), {jitter * sampling_rate_hz:.2%} "
                     "of the sampling interval")
    else:
        jitter = 0.0
    if step:
        words.append(f"the values are multiples of {step:.6g}")
    for limit, side in ((-lower if lower is not None else None, "lower"), (upper, "upper")):
        if limit is not None:
            words.append(f"{int(np.sum(axis == limit))} samples lie exactly at the {side} limit "
                         f"{limit:.6g}")
    return Integrity(len(stamps), missing, duplicates, max(back, 0), int(np.sum(~finite)), jitter,
                     step, -lower if lower is not None else None, upper, words)


def lattice(values):
    """Step of which all differences between values are multiples, or None.

    Numbers that are simply stored with few digits have a lattice too; its step is then small, and
    whether it matters is not decided here.
    """
    levels = np.unique(values[:_LATTICE_SAMPLES])
    if len(levels) < 3 or len(levels) > 0.5 * min(len(values), _LATTICE_SAMPLES):
        return None
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-9 * np.ptp(levels)]
    step = gaps.min()
    for _ in range(3):
        counts = np.round(gaps / step)
        if np.any(counts < 1):
            return None
        step = float(np.sum(gaps) / np.sum(counts))
    places = (levels - levels[0]) / step
    return step if np.max(np.abs(places - np.round(places))) < 1e-3 else None


def pile_up(values, step):
    """The largest value, if samples pile up there, or None."""
    top = values.max()
    count = int(np.sum(values == top))
    if count < _PILE:
        return None
    if step:
        # on a lattice the tail falls from level to level
        nearest = max(int(np.sum(np.abs(values - (top - k * step)) < 0.3 * step))
                      for k in (1, 2, 3))
        return float(top) if count > _PILE_RATIO * max(nearest, 1) else None
    return float(top)
