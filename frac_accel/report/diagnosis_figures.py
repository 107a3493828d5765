"""What the simulation gets wrong, by the model in use and by the extended one, in figures."""

import dataclasses

import numpy as np
from scipy.signal import welch

from ..identification.excitation import strongest_stretch
from . import figures
from .signals import close_up, segment, thinned

# Upper ends of the classes of output, as shares of the samples; the last ones are the peaks.
_CLASSES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 1.0)
_BLOCKS = 60
_FEWEST = 16
_IN_USE, _EXTENDED = "model in use", "extended model"


@dataclasses.dataclass(frozen=True)
class Compared:
    """Outputs of the model in use and of the extended one beside the measured output.

    Attributes
    ----------
    problem : Problem
    fitted : Fitted
        The model in use with the causes that are named.
    measured : ndarray, shape (n,)
        NaN where there is no sample.
    simulated, residuals : dict of str to ndarray, shape (n,)
        By model; residuals are NaN where a sample does not count.
    """

    problem: object
    fitted: object
    measured: np.ndarray
    simulated: dict
    residuals: dict

    @classmethod
    def of(cls, found):
        """Those of a Diagnosis that has fits."""
        search, p = found.engine.search, found.engine.problem
        bare = search.fit(search.base)
        named = {finding.cause: finding.effect for finding in found.findings}
        fitted = search.fit({cause: effect for cause, effect in found.best.effects.items()
                             if cause in named or cause in search.base})
        simulated = {_IN_USE: bare.output}
        residuals = {_IN_USE: bare.residual}
        if named:
            output, left = fitted.output, fitted.residual
            for effect in named.values():
                # read off the record, and not among those that were fitted
                if effect.cause not in fitted.effects:
                    output = effect.simulate(output, p.simulator(p.axis).circumstances)
            simulated[_EXTENDED], residuals[_EXTENDED] = output, left
        return cls(p, fitted, np.where(p.record.valid, p.measured, np.nan), simulated,
                   {name: np.where(p.used, values, np.nan) for name, values in residuals.items()})


def discrepancy(section, compared, found):
    """Fill a section with the figures."""
    _in_time(section, compared)
    _in_frequency(section, compared, found.baseline["noise_rms"])
    _by_amplitude(section, compared)
    _by_time(section, compared)


def _in_time(section, compared):
    p = compared.problem
    signals = {"measured": compared.measured, **compared.simulated}
    section.figure(figures.time_signals(p.time, signals, compared.residuals),
                   "Sensor's output, measured and simulated from the reference, and the residuals "
                   "(measured less simulated)" + thinned(len(p.time)))
    length = close_up(p.record.reference[:, p.axis])
    if len(p.time) > 2 * length:
        part = strongest_stretch(np.where(p.used, p.measured, 0.0), length)
        section.figure(
            figures.time_signals(
                p.time[part], {name: values[part] for name, values in signals.items()},
                {name: values[part] for name, values in compared.residuals.items()}),
            f"The {length} samples with the strongest output.")


def _in_frequency(section, compared, noise_rms):
    p = compared.problem
    size = segment(len(p.time))
    share = p.used.mean()

    def density(values):
        frequency, power = welch(np.nan_to_num(values), p.rate, "hann", size)
        return frequency, np.sqrt(power / share)
    frequency, output = density(np.where(p.used, p.measured, 0.0))
    residuals = {f"residual, {name}": density(values)[1]
                 for name, values in compared.residuals.items()}
    section.figure(
        figures.spectra(frequency, {"measured output": output, **residuals},
                        level=noise_rms * np.sqrt(2 / p.rate),
                        colours=(figures.MEASURED, *figures.SERIES)),
        "Amplitude spectral densities of the output and of the residuals, and of white noise as "
        f"strong as what may be noise: {noise_rms:.3g} output units (RMS).")


def _by_amplitude(section, compared):
    p = compared.problem
    size = np.abs(p.measured[p.used] - p.measured[p.used].mean())
    edges = np.r_[0.0, np.quantile(size, _CLASSES)]
    place = np.clip(np.searchsorted(edges, size, side="left") - 1, 0, len(_CLASSES) - 1)
    middle, rms = _grouped(place, size, [values[p.used] for values in
                                             compared.residuals.values()])
    section.figure(
        figures.lines(middle, dict(zip(compared.residuals, rms)), "output's distance from its "
                      "mean [output units]", "residual's RMS [output units]", log="y"),
        "Residual by the size of the output. What grows along this line hints at a spring that is "
        "not linear, a limit, or a gain; noise is level.")


def _by_time(section, compared):
    p = compared.problem
    place = np.arange(len(p.time))[p.used] * _BLOCKS // len(p.time)
    middle, rms = _grouped(place, p.time[p.used], [values[p.used] for values in
                                                       compared.residuals.values()])
    section.figure(
        figures.lines(middle, dict(zip(compared.residuals, rms)), "time [s]",
                      "residual's RMS [output units]", log="y"),
        "Residual by time. What changes along this line hints at a drift, at temperature, at a "
        "clock, or at a change of the excitation.")


def _grouped(place, values, residuals):
    """Mean of the values and RMS of each residual in every group with enough samples."""
    count = np.bincount(place)
    kept = count >= min(_FEWEST, count.max())

    def mean(of):
        return np.bincount(place, of)[kept] / count[kept]
    return mean(values), [np.sqrt(mean(residual**2)) for residual in residuals]
