"""Pages of a correction: before and after, in time and frequency, with what it says of itself."""

import dataclasses

import numpy as np

from ..errors import FracAccelError
from ..signals.averaged_spectra import power_of, segment_spectra
from ..signals.thinning import close_up, segment
from ..uncertainty import response_uncertainty
from . import figures, panels
from .figures import COVERAGE_FACTOR, MEASURED, MODEL, RESIDUAL
from .page import Page
from .quantity import fixed, percent, short

_BEFORE, _AFTER, _BAND = "raw / sensitivity", "corrected", "± 2u"
# Samples of a spectrum's segments, at most.
_SEGMENT = 2048


@dataclasses.dataclass(frozen=True)
class BeforeAfter:
    """One axis before and after its correction, at the same instants.

    Attributes
    ----------
    axis : {"x", "y", "z"}
    sampling_rate_hz : float
    stamps_ns, before, after : ndarray, shape (n,)
        Instants, scaled raw samples and corrected ones [m/s²].
    std : ndarray, shape (n,)
        Stated standard uncertainty of the corrected samples [m/s²]; NaN where none is known.
    band_hz : tuple of float
        That of the correction.
    reference : ndarray, shape (n,), optional
        The true acceleration [m/s²].
    """

    axis: str
    sampling_rate_hz: float
    stamps_ns: np.ndarray
    before: np.ndarray
    after: np.ndarray
    std: np.ndarray
    band_hz: tuple
    reference: np.ndarray | None = None

    @property
    def time_s(self):
        """Seconds since the first sample."""
        return 1e-9 * (self.stamps_ns - self.stamps_ns[0])

    @property
    def has_band(self):
        """Whether the corrected samples say how uncertain they are."""
        return bool(np.isfinite(self.std).any())


def correction_page(title, seen, summary, provenance=None, model=None, metrics=None):
    """Page of a correction.

    Parameters
    ----------
    title : str
    seen : list of BeforeAfter
        One for each axis.
    summary : list of str
        What is to be said first.
    provenance : dict, optional
        As for `Page`.
    model : SensorModel, optional
        Whose uncertainty the response after correction has.
    metrics : dict of str to ErrorMetrics, optional
        Of the first axis, by what they judge.
    """
    page = Page(title, provenance)
    section = page.section("Result")
    section.items(summary)
    if metrics:
        _metrics(section, metrics)
    for axis in seen:
        _axis(page, axis, model)
    return page


def _metrics(section, metrics):
    for name, found in metrics.items():
        rows = [[f"{band.band_hz[0]:.4g} to {band.band_hz[1]:.4g}", *map(fixed, (
                     100 * band.nrmse, 100 * band.amplitude_error, band.phase_error_deg,
                     100 * band.peak_error))] for band in (*found.bands, found.total)]
        section.table(["band [Hz]", "NRMSE [%]", "amplitude [%]", "phase [°]", "peak [%]"], rows,
                      f"Errors, {name}; the last row is of all bands together.")


def _axis(page, seen, model):
    section = page.section(f"Axis {seen.axis} in time")
    if seen.has_band:
        section.text(_stated(seen))
    else:
        section.text("The raw messages state no covariance and the model no noise: the corrected "
                     "samples do not say how uncertain they are, and there is no band.")
    section.figure(_over_time(seen, slice(None)),
                   f"The whole record{', and the errors' if seen.reference is not None else ''}. "
                   "Raw samples are drawn at the instants that they are corrected to.")
    section.figure(_over_time(seen, _strongest(seen)), "Where the motion is strongest.")
    section = page.section(f"Axis {seen.axis} in frequency")
    section.figure(figures.mark_band(_density(seen), seen.band_hz),
                   "Amplitude spectral densities; dashed: the band of the correction.")
    if seen.reference is not None:
        figure, words = _response(seen, model)
        section.figure(figures.mark_band(figure, seen.band_hz), words)


def _stated(seen):
    known = np.isfinite(seen.std)
    size = float(np.sqrt(np.mean(seen.std[known]**2)))
    words = f"The corrected samples state a standard uncertainty u of {size:.3g} m/s² (RMS)."
    if seen.reference is None:
        return words
    inside = np.abs(seen.after - seen.reference)[known] <= COVERAGE_FACTOR * seen.std[known]
    return (f"{words} {inside.mean():.1%} of them are within 2u of the reference; 95 % are where "
            "the error is nothing but what u stands for, and the reference has none.")


def _strongest(seen):
    signal = seen.after - seen.after.mean()
    length = min(close_up(signal), len(signal))
    energy = np.convolve(signal**2, np.ones(length), "valid")
    start = int(np.argmax(energy))
    return slice(start, start + length)


def _over_time(seen, part):
    time, before, after, std = (values[part] for values in
                                (seen.time_s, seen.before, seen.after, seen.std))
    count = 1 if seen.reference is None else 3
    labels = ["acceleration<br>[m/s²]", "error before<br>[m/s²]", "error after<br>[m/s²]"][:count]
    figure = panels.rows(count, 300 + 140 * (count - 1), "time [s]", labels,
                         weights=(0.5, 0.25, 0.25) if count == 3 else None)
    if seen.has_band:
        _band(figure, time, after, std, 1)
    if seen.reference is not None:
        panels.signal(figure, time, seen.reference[part], 1, "reference", MEASURED, width=3)
    panels.signal(figure, time, before, 1, _BEFORE, RESIDUAL)
    panels.signal(figure, time, after, 1, _AFTER, MODEL)
    if seen.reference is not None:
        if seen.has_band:
            _band(figure, time, np.zeros(len(after)), std, 3, legend=False)
        for row, name, values, colour in ((2, _BEFORE, before, RESIDUAL),
                                          (3, _AFTER, after, MODEL)):
            panels.signal(figure, time, values - seen.reference[part], row, f"error, {name}",
                          colour, legend=False)
    return figure


def _band(figure, time, middle, std, row, legend=True):
    """The interval of 2u about a signal, as wide as it is anywhere in each column of pixels."""
    half = COVERAGE_FACTOR * np.nan_to_num(std)
    if len(time) > panels.MOST_IN_LINE:
        at, low, _ = panels.ends(time, middle - half)
        high = panels.ends(time, middle + half)[2]
    else:
        at, low, high = time, middle - half, middle + half
    panels.band(figure, at, low, high, row, _BAND, legend, "#3d9c63")


def _density(seen):
    length = segment(len(seen.after), _SEGMENT)

    def density(values):
        return np.sqrt(power_of(segment_spectra(values, "hann", length)) / seen.sampling_rate_hz)
    drawn = {_BEFORE: density(seen.before), _AFTER: density(seen.after)}
    colours = [RESIDUAL, MODEL]
    if seen.reference is not None:
        drawn = {"reference": density(seen.reference),
                 "error, " + _BEFORE: density(seen.before - seen.reference),
                 "error, " + _AFTER: density(seen.after - seen.reference)}
        colours = [MEASURED, RESIDUAL, MODEL]
    frequency = np.fft.rfftfreq(length, 1 / seen.sampling_rate_hz)
    if seen.has_band:
        # what is stated, spread evenly over the band that is corrected
        low, high = seen.band_hz
        level = np.sqrt(np.nanmean(seen.std**2) / (high - low))
        drawn["stated 2u"] = np.where((frequency >= low) & (frequency <= high),
                                      COVERAGE_FACTOR * level, np.nan)
        colours.append("#3d9c63")
    return figures.spectra(frequency, drawn, "m/s²", colours=colours)


def _response(seen, model):
    """Response of raw and corrected samples to the reference, and what it shows."""
    length = segment(len(seen.after), _SEGMENT)
    reference, before, after = (segment_spectra(values, "hann", length) for values in
                                (seen.reference, seen.before, seen.after))
    frequency = np.fft.rfftfreq(length, 1 / seen.sampling_rate_hz)
    low, high = seen.band_hz
    shown = (frequency > 0) & (frequency >= low) & (frequency <= high)
    shown &= power_of(reference) > 1e-6 * power_of(reference).max()
    at = frequency[shown]
    figure = panels.rows(2, 480, "frequency [Hz]", ["amplitude ratio", "phase [°]"],
                         x_type="log")
    words = ("Response of raw and corrected samples to the reference: a true sensor has 1 and 0° "
             "throughout.")
    try:
        known = response_uncertainty(model, at, seen.axis)
        half = known.amplitude_std / known.amplitude, known.phase_std_deg
        for row, (middle, std) in enumerate(zip((1.0, 0.0), half), 1):
            _band(figure, at, np.full(len(at), middle), std, row, legend=row == 1)
        words += " Band: 2u of the model's response by the uncertainty of its parameters."
    except FracAccelError as error:
        words += f" No band of ± 2u is drawn, as the model file states none: {error}."
    for name, values, colour in ((_BEFORE, before, RESIDUAL), (_AFTER, after, MODEL)):
        ratio = (np.mean(np.conj(reference) * values, axis=0)[shown]
                 / power_of(reference)[shown])
        panels.line(figure, at, np.abs(ratio), 1, name, colour)
        phase = np.degrees(np.angle(ratio))
        # no line across the panel where it goes round
        phase[1:][np.abs(np.diff(phase)) > 180] = np.nan
        panels.line(figure, at, phase, 2, name, colour, legend=False)
    return panels.finished(figure), words


def filter_words(axis, summary):
    """What the filter of an axis is worth, from the summary of a `FilterDesign`."""
    design = summary["axes"][axis]
    delay, own = (short(s, "s") for s in (summary["filter_delay_s"], summary["sensor_delay_s"]))
    return (f"Axis {axis}: corrected from {design['band_hz'][0]:.4g} to {design['band_hz'][1]:.4g} "
            f"Hz, worst error of the filter {percent(design['worst_amplitude_error'])} and "
            f"{design['worst_phase_error_deg']:.2g}°, delay {delay}, and the sensor's own {own} "
            "taken out of the stamps.")
