"""What the reference can tell: whether it excites enough to identify a model, and in which band."""

import numpy as np
from scipy.signal import coherence, medfilt, welch

from ..errors import IdentificationError

# Power of a line or band, of the strongest, below which it is not excitation but noise or leakage.
_FLOOR = 1e-4
# Bins over which the window (its side lobes are 92 dB down) spreads a pure line.
_LINE_BINS = 8
# Share of the reference's energy that a held-out check learns from.
_LEARN = 0.6
# Share of the sensor's power that must come from the reference.
_COHERENT = 0.8


def excited_band(reference, sensor, sampling_rate_hz):
    """Band in which the reference has power and the sensor answers to it.

    Parameters
    ----------
    reference, sensor : ndarray, shape (n,)
    sampling_rate_hz : float

    Returns
    -------
    tuple of float
        Lowest and highest frequency [Hz] between which both hold for most frequencies.
    """
    frequency, power = _spectrum(reference, sampling_rate_hz)
    _, shared = coherence(reference, sensor, sampling_rate_hz, "hann", _segment(reference) // 4)
    shared = np.interp(frequency, np.linspace(0, sampling_rate_hz / 2, len(shared)), shared)
    strong = ((power > _FLOOR * power.max()) & (shared > _COHERENT)).astype(float)
    most = np.flatnonzero(medfilt(strong, 5))
    if not len(most):
        most = np.flatnonzero(power > 0.1 * power.max())
    # the window smears what is next to zero into it
    low = frequency[most[0]] if most[0] > 2 else 0.0
    return float(low), float(frequency[most[-1]])


def highest_excited(reference):
    """Highest frequency at which the reference has power [of the sampling rate]."""
    frequency, power = _spectrum(reference, 1.0)
    return frequency[np.flatnonzero(power > _FLOOR * power.max())[-1]]


def persistent_excitation(reference, sampling_rate_hz):
    """Order of persistent excitation and the lines that give it.

    Each sine is persistently exciting of order 2 (L. Ljung, *System Identification*, 2nd ed.,
    section 13.2); a stretch of continuous spectrum counts as many as its width holds.

    Returns
    -------
    order : int
    lines_hz : list of float
        Frequencies of the lines, or places within a stretch of continuous spectrum.
    """
    frequency, power = _spectrum(reference, sampling_rate_hz)
    strong = np.flatnonzero(power > _FLOOR * power.max())
    stretches = np.split(strong, np.flatnonzero(np.diff(strong) > 1) + 1) if len(strong) else []
    lines = []
    for stretch in stretches:
        count = max(1, round(len(stretch) / _LINE_BINS))
        lines += [float(np.average(frequency[part], weights=power[part]))
                  for part in np.array_split(stretch, count)]
    return 2 * len(lines), lines


def require_excitation(reference, sampling_rate_hz, parameters):
    """Refuse data that cannot identify so many parameters.

    Raises
    ------
    IdentificationError
        Saying what is excited, how much is needed and where.
    """
    order, lines = persistent_excitation(reference, sampling_rate_hz)
    if order >= parameters:
        return
    needed = -(-parameters // 2)
    where = " and ".join(f"{line:.4g} Hz" for line in lines)
    raise IdentificationError(
        f"the reference excites only {where}: persistently exciting of order {order}, but "
        f"{parameters} parameters are to be identified; excite at least {needed} frequencies, "
        f"spread below and across the sensor's resonance, or use noise, a sweep or a shock")


def strongest_stretch(reference, length):
    """Slice of `length` samples in which the reference has most energy; all of a shorter record."""
    if len(reference) <= length:
        return slice(0, len(reference))
    energy = np.r_[0, _energy(reference)]
    first = int(np.argmax(energy[length:] - energy[:-length]))
    return slice(first, first + length)


def learning_length(reference):
    """Number of samples to learn from, by the reference's energy; the rest is held out."""
    energy = _energy(reference)
    return int(np.searchsorted(energy, _LEARN * energy[-1]))


def alternating_stretches(reference, count):
    """Every other of `count` stretches in which the reference has equal energy, as a mask.

    What is learnt from the others is judged under the same kind of motion: the end of a shock is
    not like its beginning.
    """
    energy = _energy(reference)
    return (energy * (count / max(energy[-1], 1e-300))).astype(int) % 2 == 1


def _energy(reference):
    return np.cumsum(np.square(reference - reference.mean()))


def _spectrum(reference, sampling_rate_hz):
    return welch(reference, sampling_rate_hz, "blackmanharris", _segment(reference),
                 detrend="constant")


def _segment(reference):
    return min(len(reference), max(256, len(reference) // 4))
