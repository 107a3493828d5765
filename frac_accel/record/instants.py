"""Samples that were taken where their scattering stamps say, put on uniform instants."""

import numpy as np
from scipy.fft import irfft, rfft, rfftfreq
from scipy.interpolate import make_interp_spline

# Samples on either side by which a sample is predicted, and how many are enough to learn from.
_NEIGHBOURS = 8
_ENOUGH = 1 << 17
# Share of the stamps' scatter that the values must show, standard uncertainties that it must be
# above none, and that it may be away from all.
_SHOWN, _SIGNIFICANT, _ALL = 0.7, 8.0, 0.3
# Degree of the spline between samples, and times that what it misses at the stamps is added.
_DEGREE, _ROUNDS = 7, 4


def put_on_instants(topic):
    """Give a topic's samples the values of its clock's instants, where they were taken at their
    stamps; otherwise leave them as they are.

    Parameters
    ----------
    topic : Topic

    Returns
    -------
    list of str
        Words on what was done; empty where nothing was.
    """
    clock = topic.clock
    if clock.kind != "regular" or not topic.scatters or len(topic) < 100 * _NEIGHBOURS:
        return []
    slot, _, values = _bridged(topic)
    seconds = (topic.stamps_ns - topic.stamps_ns[0]) * 1e-9
    late = (seconds - clock.instants_s(topic.stamps_ns)) * clock.rate_hz
    share, std = _share_shown(values, slot, late)
    if not (share > _SHOWN and share > _SIGNIFICANT * std and abs(share - 1) < _ALL):
        return []
    put_back(topic, late)
    return [f"the {topic.name}'s samples were taken where their stamps say, which scatter by "
            f"{clock.scatter_s:.3g} s (RMS): they are put on uniform instants"]


def put_back(topic, late):
    """Give a topic's samples, each taken so `late` [samples] after the instant of its clock that it
    belongs to, the values of these instants."""
    slot, grid, values = _bridged(topic)
    measured, place = topic.values, np.clip(slot + late, 0, grid[-1])
    for _ in range(_ROUNDS):
        spline = make_interp_spline(grid, values, _DEGREE)
        values[slot] += measured - spline(place)
    topic.move(values[slot], late / topic.clock.rate_hz)


def _bridged(topic):
    """Instants of the samples from the first on, all instants, and the values at these, on straight
    lines where a sample is missing."""
    slot = (topic.clock.slot - topic.clock.slot[0]).astype(np.int64)
    grid = np.arange(slot[-1] + 1)
    return slot, grid, np.stack([np.interp(grid, slot, axis) for axis in topic.values.T], axis=1)


def _share_shown(values, slot, late):
    """Share of the stamps' scatter that values on a grid show, and its standard uncertainty.

    What the neighbours do not predict of a sample is regressed on what they would not predict if
    it had been taken `late` [samples]: the slope times that. Nothing else that is new in a sample
    knows of the stamps.
    """
    # an ever so long record tells no more
    first = max(0, (len(values) - _ENOUGH) // 2)
    values = values[first:first + _ENOUGH]
    inside = (slot >= first) & (slot < first + len(values))
    slot, late = slot[inside] - first, late[inside]
    scatter = np.zeros(len(values))
    scatter[slot] = late - late.mean()
    there = np.zeros(len(values), bool)
    there[slot] = True
    reach = 2 * _NEIGHBOURS + 1
    alone = np.convolve(there, np.ones(reach), "same") == reach
    alone[:reach] = alone[len(alone) - reach:] = False
    shared = power = 0.0
    for axis in values.T:
        moving = axis - axis.mean()
        if not moving.any():
            continue
        columns = np.stack([np.roll(moving, lag) + np.roll(moving, -lag)
                            for lag in range(1, _NEIGHBOURS + 1)], axis=1)
        weights = np.linalg.lstsq(columns[alone], moving[alone], rcond=1e-9)[0]

        def new(signal, weights=weights):
            return (signal - sum(weight * (np.roll(signal, lag) + np.roll(signal, -lag))
                                 for lag, weight in enumerate(weights, 1)))[alone]
        own, error = new(scatter * _slope(moving)), new(moving)
        variance = max(float(np.mean(error**2)), 1e-300)
        shared += own @ error / variance
        power += own @ own / variance
    if not power > 0:
        return 0.0, np.inf
    return shared / power, 1 / np.sqrt(power)


def _slope(values):
    """Derivative by the sample; wrong near the ends, which do not count."""
    return irfft(2j * np.pi * rfftfreq(len(values)) * rfft(values), len(values))
