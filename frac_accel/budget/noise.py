"""How large a sensor's noise is, where something other than the residual itself shows it."""

import dataclasses

import numpy as np
from scipy.signal import detrend
from scipy.stats import spearmanr

from ..identification.response.recognise import recognise

# RMS of the reference, of its whole RMS, below which it is at rest, and how long that must last.
_AT_REST = 0.01
_REST_S = 0.5
_REST_SAMPLES = 200
# Factor by which a covariance may differ from the scatter at rest, and that from its usual part's.
_FAR = 2.0
# Ratio of the motion in loud and quiet stretches that is needed to tell noise from what follows the
# motion, the ratio of what is left from which it does, and the chance of as high a correlation of
# ranks.
_DIFFER = 2.0
_FOLLOWS = 1.2
_P_VALUE = 0.1
_STRETCHES = 20
# Parts of a stretch at rest, which noise fills evenly.
_REST_PARTS = 10
# Of the stretches at rest, the one whose scatter counts.
_QUIETEST = 0.25
# Share of the power at rest within so many lines of one above the lowest ones that is no noise: a
# motor that runs, or a tone.
_NARROW, _LINES, _LOWEST = 0.7, 2, 5


@dataclasses.dataclass(frozen=True)
class EstablishedNoise:
    """Noise that does not rest on the residual alone.

    Attributes
    ----------
    rms : float or None
        [output units]; None where nothing shows it.
    by : {"stated", "periods", "rest", "covariance", "second_sensor", None}
    words : list of str
        What was looked at and not used, and why.
    """

    rms: float | None
    by: str | None
    words: list

    def as_dict(self):
        """As the result file has it."""
        return {"rms": self.rms, "by": self.by}


def established_noise(residual, measured, reference, used, sampling_rate_hz, covariance_std=None,
                      stated_std=None, other_sensor_residual=None, period=None):
    """The best independent evidence of how large the noise is.

    In this order: what the user states; the difference between repeated periods; the scatter at
    rest; the messages' covariance, unless it looks like a default or contradicts what is left; what
    a second sensor does not share, unless it follows the motion and so is no noise.

    Parameters
    ----------
    residual, measured : ndarray, shape (n,)
        [output units]
    reference : ndarray, shape (n, 3)
    used : ndarray of bool, shape (n,)
    sampling_rate_hz : float
    covariance_std, stated_std : float, optional
        Standard deviations [output units]; NaN counts as none.
    other_sensor_residual : ndarray, shape (n,), optional
        As in `error_budget`.
    period : int, optional
        Of the reference [samples], 0 for none; found here without it.

    Returns
    -------
    EstablishedNoise
    """
    words = []
    moving = reference[:, np.argmax(np.var(reference, axis=0))]
    if period is None:
        period = recognise(moving, sampling_rate_hz).period_samples \
            if np.ptp(moving) and len(moving) >= 64 else 0
    at_rest, narrow_hz = _rest(measured, reference, used, sampling_rate_hz)
    if narrow_hz:
        words.append(f"at rest the sensor shows a narrow band around {narrow_hz:.3g} Hz: what acts "
                     "on it there is no noise")
    left = float(np.sqrt(np.mean(residual[used]**2))) if used.any() else 0.0
    if _given(stated_std):
        if at_rest is not None and not 1 / _FAR < stated_std / max(at_rest, 1e-300) < _FAR:
            words.append(f"the stated noise of {stated_std:.3g} is not what the sensor scatters by "
                         f"at rest, {at_rest:.3g}")
        return EstablishedNoise(float(stated_std), "stated", words)
    repeated = _periods(residual, used, period)
    covariance = covariance_std if _given(covariance_std) else None
    if covariance is not None:
        trouble = _untrusted(covariance, at_rest if at_rest is not None else repeated, left)
        if trouble:
            words.append(f"the messages' covariance states a noise of {covariance:.3g}, "
                         f"which is not used: {trouble}")
            covariance = None
    for rms, by in ((repeated, "periods"), (at_rest, "rest"), (covariance, "covariance")):
        if rms is not None:
            return EstablishedNoise(float(rms), by, words)
    if other_sensor_residual is not None:
        rms = _unshared(residual, other_sensor_residual, used)
        if _follows(residual, moving, used):
            words.append("what the second sensor does not share follows the motion, or nothing "
                         "shows that it does not: it need not be noise")
        elif rms is not None:
            return EstablishedNoise(rms, "second_sensor", words)
    return EstablishedNoise(None, None, words)


def unaccounted(rms, output_rms, noise):
    """Share of the output that is neither explained nor established noise, and the sentence.

    Parameters
    ----------
    rms, output_rms : float
        Of what the model leaves, and standard deviation of the sensor's signal [output units].
    noise : EstablishedNoise

    Returns
    -------
    dict
        ``fraction`` of the output (RMS), and ``words``.
    """
    own = noise.rms or 0.0
    fraction = float(np.sqrt(max(rms**2 - own**2, 0.0)) / max(output_rms, 1e-300))
    how = {"stated": "that was stated", "rest": "that the sensor has at rest",
           "periods": "by which repeated periods differ", "covariance": "that its messages state",
           "second_sensor": "that a second sensor does not share"}
    if noise.by is None:
        words = (f"{fraction:.2g}" if fraction < 1e-6 else f"{100 * fraction:.3g} %") \
            + " of the output is unaccounted for; nothing in the record shows that it is noise"
    elif fraction == 0:
        words = f"all that is left is within the noise {how[noise.by]} ({own:.3g})"
    else:
        words = (f"{100 * fraction:.3g} % of the output is unaccounted for, beyond the noise "
                 f"{how[noise.by]} ({own:.3g})")
    return {"fraction": fraction, "words": words}


def _given(value):
    return value is not None and np.isfinite(value) and value > 0


def _untrusted(std, seen, left):
    """Why a covariance is not believed, or None."""
    if seen is not None:
        if not 1 / _FAR < std / max(seen, 1e-300) < _FAR:
            return f"the sensor scatters by {seen:.3g}"
        return None
    if std > left:
        return f"no more than {left:.3g} is left in all"
    for value in (std, std**2):
        power = np.log10(value)
        if abs(power - round(power)) < 1e-6:
            return "a power of ten is a default and no measurement"
    return None


def _rest(measured, reference, used, rate):
    """Scatter of the sensor where the reference is at rest, or None; and the frequency [Hz] of the
    narrow band that it mainly is, for which there is none, or None.

    Where values on a lattice do not scatter at all, what rounding adds once they move.
    """
    length = max(_REST_SAMPLES, min(int(np.ceil(_REST_S * rate)), len(measured) // _STRETCHES))
    count = len(measured) // length
    moving = reference - reference[used].mean(axis=0) if used.any() else reference
    whole = np.sqrt(np.sum(moving**2) / max(len(moving), 1))
    found, power = [], 0.0
    line = np.stack([np.ones(length), np.linspace(-1, 1, length)], axis=1)
    line, _ = np.linalg.qr(line)
    for place in range(count):
        rows = slice(place * length, (place + 1) * length)
        if not used[rows].all():
            continue
        part = reference[rows] - reference[rows].mean(axis=0)
        if np.sqrt(np.sum(part**2) / length) < _AT_REST * whole:
            values = measured[rows] - line @ (line.T @ measured[rows])
            found.append(_steady(values))
            power = power + np.abs(np.fft.rfft(values * np.hanning(length)))**2
    if not found:
        return None, None
    peak = _LOWEST + int(np.argmax(power[_LOWEST:]))
    if power[peak - _LINES:peak + _LINES + 1].sum() > _NARROW * power.sum():
        return None, peak * rate / length
    # the sensor may still ring in some of them
    scatter = float(np.quantile(found, _QUIETEST))
    step = _lattice(measured[used])
    if step and scatter < step / np.sqrt(12):
        scatter = float(step / np.sqrt(12))
    return (scatter if scatter > 0 else None), None


def _steady(values):
    """Scatter of values about a line; where a short part has most of it, such as the end of a
    motion, which also bends the line, the usual one of the parts about lines of their own."""
    scatter = float(np.sqrt(values @ values / (len(values) - 2)))
    parts = values[:len(values) // _REST_PARTS * _REST_PARTS].reshape(_REST_PARTS, -1)
    usual = np.sqrt(np.median(np.mean(parts**2, axis=1)))
    return scatter if scatter < _FAR * usual else \
        float(np.sqrt(np.median(np.var(detrend(parts, axis=1), axis=1, ddof=2))))


def _lattice(values):
    """Distance of neighbouring values where few differ, or None."""
    levels = np.unique(values[:20_000])
    if not 2 < len(levels) < 0.5 * min(len(values), 20_000):
        return None
    gaps = np.diff(levels)
    step = gaps[gaps > 1e-9 * np.ptp(levels)].min()
    ratio = gaps / step
    return float(step) if np.max(np.abs(ratio - np.round(ratio))) < 0.02 else None


def _periods(residual, used, period):
    """Noise by the difference of neighbouring periods, or None."""
    if not period or len(residual) < 2 * period:
        return None
    both = used[period:] & used[:-period]
    change = (residual[period:] - residual[:-period])**2 * both
    count = (len(residual) - period) // period
    start = len(change) - count * period
    power = change[start:].reshape(count, period).sum(axis=1)
    here = both[start:].reshape(count, period).sum(axis=1)
    good = here > period // 2
    if not good.any():
        return None
    # the median: the first periods may hold a transient
    return float(np.sqrt(np.median(power[good] / here[good]) / 2))


def _unshared(residual, other, used):
    one, two = residual[used] - residual[used].mean(), other[used] - other[used].mean()
    power = np.mean(one**2) - max(np.mean(one * two), 0.0)
    return float(np.sqrt(power)) if power > 0 else None


def _follows(residual, moving, used):
    """Whether what is left is larger where more moves, or nothing shows that it is not."""
    edges = np.linspace(0, len(residual), _STRETCHES + 1).astype(int)[:-1]
    count = np.maximum(np.add.reduceat(used.astype(float), edges), 1)
    left = np.sqrt(np.add.reduceat(residual**2 * used, edges) / count)
    level = np.sqrt(np.add.reduceat((moving - moving[used].mean())**2 * used, edges) / count)
    order = np.argsort(level)
    quiet, loud = order[:_STRETCHES // 2], order[_STRETCHES // 2:]
    if np.median(level[loud]) < _DIFFER * np.median(level[quiet]):
        return True
    alike = spearmanr(left, level)
    return bool(np.median(left[loud]) > _FOLLOWS * np.median(left[quiet])
                or (alike.statistic > 0 and alike.pvalue < _P_VALUE))
