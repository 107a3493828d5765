"""What an identification rests on, as plain numbers and arrays: the signals that its page draws."""

import dataclasses

import numpy as np

from ..signals.averaged_spectra import coherence_of, power_of, segment_spectra
from ..signals.thinning import close_up, legible, segment, thinned
from .response.excitation import strongest_stretch

# Points of a signal, and samples of a spectrum's segments (half as many points).
MOST_POINTS, _SEGMENT = 2000, 4096


@dataclasses.dataclass(frozen=True)
class Evidence:
    """Signals of the record, and of several records of the first.

    Attributes
    ----------
    axis : {"x", "y", "z"}
    sampling_rate_hz : float
    samples : int
        Instants of the record.
    signals : dict
        ``whole`` and, of longer records, ``close_up``, each with ``measured``, ``model`` and
        ``residual`` as pairs of time [s] and values [output units], thinned to at most
        `MOST_POINTS`; NaN where there is no sample, or none that was judged.
    close_up_samples : int
    density : dict
        ``frequency_hz``, the amplitude densities of ``reference`` [m/s²/sqrt(Hz)], ``output`` and
        ``residual`` [output units/sqrt(Hz)], and the ``coherence`` of reference and sensor.
    """

    axis: str
    sampling_rate_hz: float
    samples: int
    signals: dict
    close_up_samples: int
    density: dict

    @classmethod
    def of(cls, data, residual):
        """Evidence of one axis of a record.

        Parameters
        ----------
        data : Data
        residual : ndarray, shape (n,)
            Measured less simulated [output units]; NaN where not judged.
        """
        pair, rate = data.pair, data.pair.sampling_rate_hz
        time = np.arange(len(pair)) / rate
        signals = {"measured": np.where(pair.valid, data.sensor, np.nan),
                   "model": data.sensor - residual, "residual": residual}
        length = close_up(data.reference)
        views = {"whole": slice(None)}
        if len(pair) > 2 * length:
            views["close_up"] = strongest_stretch(data.sensor, length)
        return cls(data.axis, float(rate), len(pair), {
            view: {name: thinned(time[part], values[part], MOST_POINTS)
                   for name, values in signals.items()} for view, part in views.items()},
            int(length), _density(data.reference, data.sensor, residual, rate))

    @classmethod
    def from_dict(cls, data):
        """Evidence from the plain lists of a result file."""
        return cls(**{**data, "density": {name: np.array(values, float)
                                          for name, values in data["density"].items()},
                      "signals": {view: {name: tuple(np.array(part, float) for part in pair)
                                         for name, pair in by_name.items()}
                                  for view, by_name in data["signals"].items()}})


def _density(reference, sensor, residual, rate):
    judged = np.isfinite(residual)
    length = segment(len(reference), _SEGMENT)
    moving, answer, left = (segment_spectra(values, "hann", length)
                            for values in (reference, sensor, np.where(judged, residual, 0)))
    return {name: legible(values) for name, values in (
        ("frequency_hz", np.fft.rfftfreq(length, 1 / rate)),
        ("reference", np.sqrt(power_of(moving) / rate)),
        ("output", np.sqrt(power_of(answer) / rate)),
        ("residual", np.sqrt(power_of(left) / judged.mean() / rate)),
        ("coherence", coherence_of(moving, answer)))}
