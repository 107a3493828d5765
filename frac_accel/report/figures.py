"""Figures of the reports. Each function gives a plotly figure for `Section.figure`.

Signals of any length are thinned to their envelope, so that a page stays small.
"""

import dataclasses

import numpy as np

from ..signals.thinning import envelope
from . import panels
from .panels import COVERAGE_FACTOR, MEASURED, MODEL, RESIDUAL, SERIES

__all__ = ["COVERAGE_FACTOR", "MEASURED", "MODEL", "RESIDUAL", "SERIES", "ResponseCurve", "bode",
           "bode_curves", "correlation", "envelope", "lines", "mark_band", "response_deviation",
           "response_interval", "shades", "spectra", "time_signals"]


@dataclasses.dataclass(frozen=True)
class ResponseCurve:
    """A frequency response with its 95 % interval.

    Attributes
    ----------
    frequency_hz : ndarray, shape (m,)
    response : ndarray of complex, shape (m,)
    amplitude_interval : tuple of two ndarray, shape (m,), or None
        Limits relative to the amplitude: -0.01 and 0.01 for one percent.
    phase_interval_rad : tuple of two ndarray, shape (m,), or None
        Limits as differences from the phase.
    """

    frequency_hz: np.ndarray
    response: np.ndarray
    amplitude_interval: tuple | None = None
    phase_interval_rad: tuple | None = None


def bode(curve, points=None, modelled=None):
    """Amplitude and phase over frequency.

    Parameters
    ----------
    curve : ResponseCurve
    points : ResponsePoints, optional
    modelled : ndarray of complex, shape (k,)
        The model's response at the frequencies of the points.
    """
    figure = panels.rows(2, 560, "frequency [Hz]",
                         ["amplitude [output units per m/s²]", "phase [°]"], weights=(0.6, 0.4),
                         x_type="log")
    amplitude, phase = np.abs(curve.response), np.unwrap(np.angle(curve.response))
    frequency = curve.frequency_hz
    if curve.amplitude_interval is not None:
        low, high = curve.amplitude_interval
        panels.band(figure, frequency, amplitude * (1 + low), amplitude * (1 + high), 1)
        low, high = curve.phase_interval_rad
        panels.band(figure, frequency, np.degrees(phase + low), np.degrees(phase + high), 2,
              legend=False)
    if points is not None:
        ratio = points.response / modelled
        # on the model's branch, so that no point lies a turn away
        own = np.interp(points.frequency_hz, frequency, phase) + np.angle(ratio)
        size = np.abs(points.response)
        panels.points(figure, points.frequency_hz, size, 1, size * points.std_amplitude)
        panels.points(figure, points.frequency_hz, np.degrees(own), 2,
                      np.degrees(points.std_phase_rad), legend=False)
    panels.line(figure, frequency, amplitude, 1, "model", MODEL)
    panels.line(figure, frequency, np.degrees(phase), 2, "model", MODEL, legend=False)
    figure.update_yaxes(type="log", row=1, col=1)
    return panels.finished(figure)


def bode_curves(frequency_hz, curves, colours=SERIES):
    """Magnitude in decibels and phase of several responses over frequency.

    Parameters
    ----------
    frequency_hz : ndarray, shape (m,)
    curves : dict of str to tuple of two ndarray, shape (m,)
        Magnitude [dB] and phase [degree].
    colours : sequence of str
        At least as many as there are curves.
    """
    figure = panels.rows(2, 520, "frequency [Hz]", ["magnitude [dB]", "phase [°]"], x_type="log")
    for (name, parts), colour in zip(curves.items(), colours):
        for row, values in enumerate(parts, 1):
            panels.line(figure, frequency_hz, values, row, name, colour, legend=row == 1)
    return panels.finished(figure)


def shades(count):
    """That many colours from blue to orange, for curves whose order matters."""
    share = np.linspace(0, 1, count)[:, None]
    mixed = np.round((1 - share) * (47, 134, 201) + share * (217, 119, 43)).astype(int)
    return [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in mixed]


def response_deviation(curve, points, modelled):
    """How far the measured points are from the model, with the intervals of both.

    Parameters
    ----------
    curve : ResponseCurve
    points : ResponsePoints
    modelled : ndarray of complex, shape (k,)
        The model's response at the frequencies of the points.
    """
    figure = panels.rows(2, 520, "frequency [Hz]", ["amplitude [%]", "phase [°]"], x_type="log")
    ratio = points.response / modelled
    spreads = 100 * np.abs(ratio) * points.std_amplitude, np.degrees(points.std_phase_rad)
    if curve.amplitude_interval is not None:
        panels.band(figure, curve.frequency_hz,
                    *(100 * limit for limit in curve.amplitude_interval), 1)
        panels.band(figure, curve.frequency_hz, *map(np.degrees, curve.phase_interval_rad), 2,
                    legend=False)
    zero = np.zeros(2)
    ends = curve.frequency_hz[[0, -1]]
    shown = 100 * (np.abs(ratio) - 1), np.degrees(np.angle(ratio))
    for row, (values, spread) in enumerate(zip(shown, spreads), 1):
        panels.points(figure, points.frequency_hz, values, row, spread, legend=row == 1)
        panels.line(figure, ends, zero, row, "model", MODEL, legend=row == 1)
        panels.focus(figure, values, row)
    return panels.finished(figure)


def response_interval(curve):
    """Half-widths of the interval of a response: what a calibration certificate states.

    Parameters
    ----------
    curve : ResponseCurve
        With its intervals.
    """
    figure = panels.rows(2, 420, "frequency [Hz]", ["amplitude [± %]", "phase [± °]"], x_type="log")
    low, high = curve.amplitude_interval
    panels.line(figure, curve.frequency_hz, 50 * (high - low), 1, "amplitude", MODEL, legend=False)
    low, high = curve.phase_interval_rad
    panels.line(figure, curve.frequency_hz, np.degrees(high - low) / 2, 2, "phase", MODEL,
                legend=False)
    figure.update_yaxes(rangemode="tozero")
    return panels.finished(figure)


def mark_band(figure, band_hz):
    """Mark the ends of a frequency band in a figure over frequency.

    Parameters
    ----------
    figure : plotly.graph_objects.Figure
    band_hz : sequence of two float
        An end at zero is not marked: no logarithmic axis has it.

    Returns
    -------
    plotly.graph_objects.Figure
        The same.
    """
    for end in band_hz:
        if end > 0:
            figure.add_shape(type="line", x0=end, x1=end, xref="x", y0=0, y1=1, yref="paper",
                             line={"color": MEASURED, "width": 1, "dash": "dash"})
    return figure


def time_signals(signals, residual):
    """Signals over time, and below them what is left.

    Parameters
    ----------
    signals : dict of str to pair of ndarray, shape (n,)
        Times and values, each pair of a length of its own; NaN leaves a gap.
    residual : pair of ndarray, or dict of str to such pairs
        A dict where several signals have one each, by their names.
    """
    figure = panels.rows(2, 480, "time [s]", ["output<br>[output units]",
                                              "residual<br>[output units]"], weights=(0.6, 0.4))
    colours = dict(zip(signals, (MEASURED, *SERIES)))
    for name, values in signals.items():
        # the measured signal shows on both sides of the model that is drawn upon it
        panels.signal(figure, *values, 1, name, colours[name],
                      width=3 if colours[name] is MEASURED else 1.2)
    if isinstance(residual, dict):
        for name, values in residual.items():
            panels.signal(figure, *values, 2, f"residual of the {name}", colours[name],
                          legend=False)
    else:
        panels.signal(figure, *residual, 2, "residual", RESIDUAL)
    return figure


def spectra(frequency_hz, densities, unit="output units", level=None,
            colours=(MEASURED, RESIDUAL, *SERIES)):
    """Amplitude spectral densities.

    Parameters
    ----------
    frequency_hz : ndarray, shape (m,)
    densities : dict of str to ndarray, shape (m,)
    unit : str
        Of the signals.
    level : float, optional
        Density of white noise, drawn as a line.
    colours : sequence of str
        Of the densities in their order.
    """
    figure = panels.rows(1, 420, "frequency [Hz]", [f"density [{unit}/√Hz]"], x_type="log")
    above = frequency_hz > 0
    for (name, values), colour in zip(densities.items(), colours):
        panels.line(figure, frequency_hz[above], values[above], 1, name, colour,
              legend=len(densities) > 1 or level is not None)
    if level is not None:
        panels.line(figure, frequency_hz[above][[0, -1]], np.full(2, level), 1, "white noise",
                    MODEL, dash="dot")
    figure.update_yaxes(type="log")
    return panels.finished(figure)


def correlation(lags, values, bound, x_label="lag [samples]", y_label="correlation"):
    """Correlation over lags, and the interval in which chance alone leaves it.

    Parameters
    ----------
    lags, values : ndarray, shape (m,)
    bound : float or ndarray, shape (m,)
        Half-width of the interval about zero.
    x_label, y_label : str
    """
    figure = panels.rows(1, 320, x_label, [y_label])
    bound = np.broadcast_to(bound, np.shape(lags))
    panels.band(figure, lags, -bound, bound, 1, name="chance alone")
    stems = np.full(3 * len(lags), np.nan)
    stems[0::3], stems[1::3] = 0, values
    panels.line(figure, np.repeat(lags, 3), stems, 1, "", RESIDUAL, legend=False)
    panels.add(figure, 1, x=lags, y=values, mode="markers", name=y_label, showlegend=False,
         marker={"color": RESIDUAL, "size": 4})
    return panels.finished(figure)


def lines(x, series, x_label, y_label, log=""):
    """Lines over a common axis.

    Parameters
    ----------
    x : ndarray, shape (m,)
    series : dict of str to ndarray, shape (m,)
    x_label, y_label : str
    log : str
        Letters of the axes that are logarithmic: ``"x"``, ``"y"``, ``"xy"``.
    """
    figure = panels.rows(1, 380, x_label, [y_label], x_type="log" if "x" in log else "linear")
    for (name, values), colour in zip(series.items(), SERIES):
        panels.line(figure, *envelope(x, values), 1, name, colour, legend=len(series) > 1)
    if "y" in log:
        figure.update_yaxes(type="log")
    return panels.finished(figure)


def by_date(points):
    """Errors of many bags by date, a colour for each verdict.

    Parameters
    ----------
    points : list of dict
        ``start_ns``, ``nrmse``, ``verdict``, ``bag``; and ``page``, which a click opens, or None.
    """
    figure = panels.rows(1, 420, "date", ["error / output"], x_type="date")
    figure.update_yaxes(type="log", tickformat=".2~%")
    for colour, verdict in zip(SERIES, sorted({str(point["verdict"]) for point in points})):
        mine = [point for point in points if str(point["verdict"]) == verdict]
        panels.add(
            figure, 1, mode="markers", name=verdict.replace("_", " "), marker={"color": colour},
            x=[np.datetime64(point["start_ns"], "ns").astype(str) for point in mine],
            y=[point["nrmse"] for point in mine], text=[point["bag"] for point in mine],
            customdata=[point["page"] or "" for point in mine])
    return panels.finished(figure)
