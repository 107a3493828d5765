"""The page of an identification: what was excited, what was found, and how far to trust it."""

import numpy as np

from ..errors import ModelError
from ..identification.evidence import MOST_POINTS
from ..uncertainty import response_uncertainty
from . import figures
from .page import Page
from .quantity import cells, left_open_by, percent, written
from .signals import over_time, sentence

# Frequencies of the drawn response.
_FREQUENCIES = 400
# Two parameters that depend on each other more than this are named.
_STRONG_CORRELATION = 0.9


def identification_page(result, provenance=None):
    """Page of an identified model.

    Parameters
    ----------
    result : Identification
    provenance : dict, optional
        As for `Page`.
    """
    page = Page(f"Identification: {result.structure}, axis {result.evidence.axis}", provenance)
    _summary(page.section("Result"), result)
    _parameters(page.section("Parameters"), result)
    _excitation(page.section("What was excited"), result.excitation, result.evidence)
    _response(page.section("Frequency response"), result)
    _residual(page.section("Residual"), result.evidence, result.model.noise_std)
    if result.validation.residual:
        _residual_tests(page.section("Residual tests"), result.validation.residual)
    if result.validation.held_out_bands:
        _held_out_bands(page.section("Held-out data by octaves"), result.validation)
    if result.validation.records:
        _records(page.section("Agreement of the records"), result.validation.records)
    return page


def _summary(section, result):
    section.notice(f"Structure: {result.structure} ({result.reason}).")
    section.text(f"The model leaves {result.nrmse:.3%} of the sensor's output unexplained (RMS of "
                 "the residual over the standard deviation of the output). "
                 + _held_out(result.held_out_nrmse))
    section.items([sentence(words) for words in result.validation.verdict])
    if result.notes:
        section.text("Before you trust the model:").items(result.notes)


def _held_out(nrmse):
    if not np.isfinite(nrmse):
        return "No part of the record could be held out to judge it on unseen data."
    return (f"A model fitted to the first part of the record alone leaves {nrmse:.3%} on the rest, "
            "which it has not seen.")


def _parameters(section, result):
    rows, left_open = [], left_open_by(result.parameters, result.model.core)
    for name, entry in result.parameters.items():
        if name in left_open:
            rows.append([name, "open: not determined", "–", "–", "–", entry["unit"]])
            continue
        value, std = entry["value"], entry["std"]
        shown, uncertainty, *others = cells(value, std, entry["unit"])
        relative = percent(std / abs(value)) if uncertainty != "–" and value else "–"
        rows.append([name, shown, uncertainty, relative, *others])
    section.table(["parameter", "value", "standard uncertainty", "relative",
                   "95 % interval (k = 2)", "unit"], rows,
                  "Estimates. The uncertainties allow for a residual that is not white; they do "
                  "not hold what the structure of the model leaves out.")
    content = result.model.metadata["covariance"]
    names, covariance = content["parameters"], np.array(content["matrix"])
    std = np.sqrt(np.diag(covariance))
    names, kept = [name for name, known in zip(names, std > 0) if known], std > 0
    matrix = covariance[np.ix_(kept, kept)] / np.outer(std[kept], std[kept])
    # adding zero takes the sign off a zero
    rows = [[name, *(f"{round(value, 2) + 0.0:.2f}" for value in line[:i + 1]),
             *[""] * (len(names) - i - 1)] for i, (name, line) in enumerate(zip(names, matrix))]
    section.table(["", *names], rows, "Correlation of the estimates.")
    strong = [f"{names[i]} and {names[j]} ({matrix[i, j]:.2f})"
              for i in range(len(names)) for j in range(i) if
              abs(matrix[i, j]) > _STRONG_CORRELATION]
    if strong:
        section.text("Correlated: " + "; ".join(strong) + ".")


def _excitation(section, excited, seen):
    samples, rate = seen.samples, seen.sampling_rate_hz
    (first, last), (low, high) = excited.excited_hz, excited.band_hz
    section.text(sentence(excited.description)
                 + f" {samples} samples at {rate:.6g} Hz ({samples / rate:.4g} s). The "
                 f"reference has power from {first:.4g} Hz to {last:.4g} Hz, and the sensor "
                 f"answers to it from {low:.4g} Hz to {high:.4g} Hz; elsewhere the model is "
                 "extrapolated.")
    rows = [["order of persistent excitation", str(excited.order), f"{excited.needed} needed"],
            ["RMS", f"{excited.rms:.4g}", "m/s²"],
            ["RMS of the quietest twentieth", f"{excited.quietest_rms:.4g}", "m/s²"],
            ["RMS of the loudest twentieth", f"{excited.loudest_rms:.4g}", "m/s²"],
            ["peak", f"{excited.peak:.4g}", "m/s²"],
            ["crest factor", f"{excited.crest_factor:.3g}", ""],
            *([what, str(count), f"of {excited.samples}, left out"] for what, count in (
                ("samples missing in a topic", excited.missing), ("clipped", excited.clipped),
                ("standing still", excited.standing)) if count)]
    section.table(["reference, without its mean", "value", ""], rows,
                  "Excitation, and what does not count.")
    frequency = seen.density["frequency_hz"]
    section.figure(
        figures.spectra(frequency, {"reference": seen.density["reference"]}, "m/s²"),
        "Amplitude spectral density of the reference.")
    above = frequency > 0
    section.figure(
        figures.lines(frequency[above], {"coherence": seen.density["coherence"][above]},
                      "frequency [Hz]", "coherence", log="x"),
        "Coherence of reference and sensor: the share of the sensor's power that a linear sensor "
        "would owe to the reference.")


def _response(section, result):
    model, points, axis = result.model, result.points, result.evidence.axis
    low, high = model.band_hz
    lowest = low or (points.frequency_hz[0] if points else high / 1000)
    frequency = np.geomspace(min(lowest, points.frequency_hz[0]) if points else lowest,
                             max(high, points.frequency_hz[-1]) if points else high, _FREQUENCIES)
    curve, method = _curve(model, frequency, axis)
    certain = curve.amplitude_interval is not None
    interval = (f", its 95 % interval from the uncertainty of the parameters ({method})" if certain
                else f" without an interval: {method}")
    modelled = model.frequency_response(points.frequency_hz, axis) if points else None

    def add(figure, caption):
        section.figure(figures.mark_band(figure, (low, high)), caption)
    add(figures.bode(curve, points, modelled),
        f"Frequency response of the model{interval}" + (
            f", and measured without a model at {len(points)} frequencies: {points.method}."
            if points else ".")
        + f" Beyond the dashed lines, {low:.4g} Hz and {high:.4g} Hz, the model is extrapolated.")
    if certain:
        add(figures.response_interval(curve),
            "Expanded uncertainty (k = 2, 95 %) that the parameters give the model's amplitude and "
            "phase. What the model leaves out is not in it: see the residual.")
    if not points:
        return
    add(figures.response_deviation(curve, points, modelled),
        "The measured response relative to the model's. Bars and bands are 95 % intervals (k = 2).")
    if points.distortion:
        section.text(sentence(points.distortion["words"]))
    if result.frequency_domain:
        _frequency_domain(section, result)


def _frequency_domain(section, result):
    compared = result.frequency_domain
    section.text(sentence(compared["words"]))
    rows = []
    for name, entry in compared["parameters"].items():
        own = result.parameters[name]
        difference = entry["value"] - own["value"]
        combined = np.hypot(entry["std"], own["std"])
        rows.append([name, written(own["value"], own["std"], own["unit"]),
                     written(entry["value"], entry["std"], own["unit"]),
                     f"{difference / combined:.2f}"])
    section.table(["parameter", "time domain", "frequency domain", "difference / u"],
                  rows, "The same structure fitted to the signals and to the points above, ± "
                  "standard uncertainties; u is that of the difference as if both were "
                  "independent.")


def _residual(section, seen, noise):
    def drawn(view):
        signals = dict(view)
        residual = signals.pop("residual")
        return figures.time_signals(signals, residual)
    over_time(section, seen, drawn, MOST_POINTS,
              "Sensor's output, measured and by the model, and the residual")
    density = seen.density
    section.figure(
        figures.spectra(density["frequency_hz"], {"measured output": density["output"],
                                                  "residual": density["residual"]},
                        level=noise * np.sqrt(2 / seen.sampling_rate_hz)),
        f"Amplitude spectral densities. White noise of the sensor: {noise:.3g} output units "
        "(standard deviation), from the residual above half the Nyquist frequency.")


def _residual_tests(section, tests):
    rows = [[name, f"{statistic:.1f}", str(freedom), f"{p_value:.3g}",
             "passed" if good else "failed"]
            for name, statistic, freedom, p_value, good in (
                ("residual is white", tests.whiteness_statistic, len(tests.lags),
                 tests.whiteness_p_value, tests.white),
                ("residual does not depend linearly on the reference",
                 tests.independence_statistic, tests.independence_freedom,
                 tests.independence_p_value, tests.independent))]
    section.table(["hypothesis", "chi-squared", "degrees of freedom", "p value", "at 1 %"], rows,
                  "Tests of the residual. Noise may be coloured; dependence on the reference means "
                  "that something is missing from the model.")
    section.text(f"The reference still explains {tests.dependent_share:.1%} of the residual (RMS).")
    section.figure(figures.correlation(tests.lags, tests.autocorrelation,
                                       tests.autocorrelation_band, y_label="autocorrelation"),
                   "Autocorrelation of the residual, and what 99 % of the coefficients of white "
                   "noise stay within.")
    section.figure(figures.correlation(tests.reference_lags, tests.reference_correlation,
                                       tests.reference_band,
                                       "samples by which the reference is earlier",
                                       "correlation with reference"),
                   "Correlation of the residual with the reference, and what 99 % of the "
                   "coefficients of unrelated noise of the same spectrum stay within.")


def _held_out_bands(section, validation):
    rows = [[f"{band.band_hz[0]:.4g} to {band.band_hz[1]:.4g}", f"{band.nrmse:.2%}",
             f"{band.floor:.2%}" if np.isfinite(band.floor) else "–"]
            for band in validation.held_out_bands if np.isfinite(band.nrmse)]
    section.table(["band [Hz]", "residual", "no linear model explains"], rows,
                  "RMS of the residual on data that the fit has not seen, of the output in the "
                  "same band.")


def _records(section, records):
    rows = [[name, *(f"{value:.3%}" for value in line)]
            for name, line in (*zip(records.records, records.nrmse),
                               ("all together", records.combined_nrmse))]
    section.table(["model of, judged on", *records.records], rows,
                  "Residual of each record's model on each record.")
    rows = [[name, *(f"{value:.6g} ± {std:.2g}" for value, std in zip(values, stds))]
            for name, values, stds in zip(records.parameters, records.values.T, records.std.T)]
    section.table(["parameter", *records.records], rows,
                  f"Parameters of each record. Chi-squared {records.statistic:.1f} of "
                  f"{records.freedom} degrees of freedom, p = {records.p_value:.2g}.")


def _curve(model, frequency_hz, axis):
    """The model's response with the interval that the parameters' uncertainty gives it, and how.

    Without interval, and why, where parameters that the data leave open give none.
    """
    try:
        known = response_uncertainty(model, frequency_hz, axis)
    except ModelError as error:
        return figures.ResponseCurve(frequency_hz, model.frequency_response(frequency_hz, axis),
                                     None, None), str(error)
    around = known.phase_interval_deg - known.phase_deg[:, None]
    return figures.ResponseCurve(
        frequency_hz, model.frequency_response(frequency_hz, axis),
        tuple((known.amplitude_interval / known.amplitude[:, None] - 1).T),
        tuple(np.radians(around).T)), known.method
