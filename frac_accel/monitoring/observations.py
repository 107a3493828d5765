"""What one sensor tells of itself without a reference: observations, never causes.

Its noise, its resonance and its offset at standstill are learnt over the first windows and compared
with later ones. What makes them change, a rougher road among others, one sensor cannot say.
"""

import collections
import dataclasses

import numpy as np
from scipy.ndimage import median_filter

from ..model import AXES
from ..record.lattice import lattice_step
from ..signals.averaged_spectra import power_of, segment_spectra
from ..signals.sample_rate import estimate_rate

# Windows that are learnt from, and in a row that must agree before something is said.
LEARNING = 12
_IN_A_ROW = 3
_GRAVITY = 9.80665
# Share of the usual motion below which a window counts as standstill.
_STANDING = 0.05
# Changes that are told: factor of the noise, of the lattice's step, share of the resonance's
# frequency, and offset at standstill [m/s²].
_NOISIER = 2.0
_COARSER = 1.9
_MOVED = 0.1
_OFF = 0.3
# A peak stands that much above the spectrum around it, and is usual where it stays within a share.
_PEAK = 10.0
_STAYS = 0.03
_SEGMENT = 1024
_LINE = 9  # frequencies
_FEWEST = 512


@dataclasses.dataclass(frozen=True)
class Observation:
    """Something that is not as usual.

    Attributes
    ----------
    kind : str
        noise, stuck, lost bits, offset at standstill, or resonance.
    axis : str
        Empty for all together.
    value, usual : float
    words : str
    """

    kind: str
    axis: str
    value: float
    usual: float
    words: str


class Observer:
    """Watches one sensor alone.

    Parameters
    ----------
    sensitivity : float
        Output units per m/s², for the offset at standstill.
    """

    def __init__(self, sensitivity=1.0):
        self._sensitivity, self._learnt = sensitivity, []
        self._in_a_row = collections.Counter()

    def add(self, samples):
        """Observations that hold for several windows in a row, the new one the last.

        Parameters
        ----------
        samples : Samples
            A window of ten seconds or so.

        Returns
        -------
        list of Observation
        """
        rate = estimate_rate(samples.stamps_ns) if len(samples.stamps_ns) > _FEWEST else None
        if not rate or not np.isfinite(samples.values).all():
            return []
        figures = _figures(samples.values, rate)
        if len(self._learnt) < LEARNING:
            self._learnt.append(figures)
            return []
        found = self._against_usual(figures)
        seen = {(entry.kind, entry.axis) for entry in found}
        self._in_a_row = collections.Counter({key: self._in_a_row[key] + 1 for key in seen})
        return [entry for entry in found
                if self._in_a_row[entry.kind, entry.axis] >= _IN_A_ROW]

    def _against_usual(self, figures):
        found = []
        for i, axis in enumerate(AXES):
            usual = {key: np.array([own[key][i] for own in self._learnt]) for key in figures}
            now = {key: float(values[i]) for key, values in figures.items()}
            found += [entry for entry in (
                _stuck(axis, now, usual), _noise(axis, now, usual), _bits(axis, now, usual),
                _resonance(axis, now, usual)) if entry is not None]
        standing = max(figures["motion"]) < _STANDING * max(
            np.median([max(own["motion"]) for own in self._learnt]), 1e-300)
        size = float(np.linalg.norm(figures["mean"])) / self._sensitivity
        if standing and abs(size - _GRAVITY) > _OFF:
            found.append(Observation(
                "offset at standstill", "", size, _GRAVITY,
                f"at standstill it shows {size:.3f} m/s² where gravity is {_GRAVITY} m/s²"))
        return found


def _figures(values, rate):
    """Of one window, each for three axes."""
    second = np.diff(values, 2, axis=0)
    size = min(_SEGMENT, len(values) // 4)
    frequency = np.arange(size // 2 + 1) * rate / size
    density = [power_of(segment_spectra(column, "hann", size)) for column in values.T]
    steps = [lattice_step(column) for column in values.T]
    return {
        "motion": values.std(axis=0), "mean": values.mean(axis=0),
        # of white noise the second differences have six times the variance
        "noise": np.median(np.abs(second), axis=0) / 0.6745 / np.sqrt(6),
        "step": np.array([np.nan if step is None else step for step in steps]),
        "peak": np.array([_peak(frequency, own) for own in density])}


def _peak(frequency, density):
    """Frequency of the peak that stands highest above the spectrum around it, or NaN."""
    # a line, such as of an engine, is no resonance: it is narrower than the median's window
    level = median_filter(np.log(np.maximum(density, 1e-300)), _LINE)
    around = median_filter(level, max(len(level) // 4, 3))
    inner = slice(_LINE, -_LINE)
    place = _LINE + int(np.argmax((level - around)[inner]))
    return float(frequency[place]) if np.exp(level[place] - around[place]) > _PEAK else np.nan


def _stuck(axis, now, usual):
    if now["motion"] > 0 or not np.median(usual["motion"]) > 0:
        return None
    return Observation("stuck", axis, 0.0, float(np.median(usual["motion"])),
                       f"axis {axis} says one value only")


def _noise(axis, now, usual):
    level = float(np.max(usual["noise"]))
    if not now["noise"] > _NOISIER * level > 0:
        return None
    return Observation("noise", axis, now["noise"], level,
                       f"axis {axis} scatters by {now['noise']:.3g} from sample to sample, usually "
                       f"by at most {level:.3g}: noise, or motion at high frequencies")


def _bits(axis, now, usual):
    steps = usual["step"][np.isfinite(usual["step"])]
    if len(steps) < LEARNING // 2 or not now["step"] > _COARSER * np.max(steps):
        return None
    return Observation("lost bits", axis, now["step"], float(np.median(steps)),
                       f"axis {axis} has steps of {now['step']:.3g}, usually of "
                       f"{np.median(steps):.3g}: its lowest bits do not move")


def _resonance(axis, now, usual):
    peaks = usual["peak"][np.isfinite(usual["peak"])]
    if len(peaks) < LEARNING - 2 or np.ptp(peaks) > _STAYS * np.median(peaks):
        return None
    middle = float(np.median(peaks))
    if not abs(now["peak"] - middle) > _MOVED * middle:
        return None
    return Observation("resonance", axis, now["peak"], middle,
                       f"axis {axis} has its strongest resonance at {now['peak']:.4g} Hz, usually "
                       f"at {middle:.4g} Hz")
