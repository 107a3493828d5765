"""Sections of the seed paper's page on the experiment done properly."""

import numpy as np

from ..identification.judge.residual_tests import p_words
from ..paper.study.answer import factor, rival
from ..paper.study.candidates import CLASSICAL, FRACTIONAL
from ..paper.study.map import BANDS_HZ, NOISE_DB, ORDERS, SEEDS, VERDICTS
from ..paper.study.sweep import best
from . import figures
from .quantity import written
from .signals import sentence


def study_sections(page, study):
    """Add the sections on a `Study` to a page."""
    _bench(page.section("The experiment done properly: bench and method"), study)
    _held_out(page.section("Held-out errors on the bench"), study)
    _swept(page.section("Orders swept and optimised"), study)
    _map(page.section("The map: when a fractional model helps"), study)


def _bench(section, study):
    section.text(
        "A simulated bench as in the paper's Figure 1: a shaker moves a reference and a sensor "
        "under test; each has its noise (80 and 60 dB below the signal); a card digitises both at "
        "10 kHz in steps of 2⁻⁷ m/s², the sensor's channel 70 µs late. The records were made by a "
        "simulator that shares no code with the package, which steps the equation of motion at 64 "
        "times the rate. The sensor's resonance is at 650 Hz with a damping ratio of 0.12: within "
        "reach of the card, unlike that of the paper's sensor.")
    section.text(
        "Models are identified from 0.8 s of noise from 10 to 1500 Hz, and judged on stepped sines "
        "of 100 to 1200 Hz in a second record that no fit has seen. The error is that of the "
        "model's response against the measured one, amplitude and phase together; its uncertainty "
        "is that of the sine fits and of the model's parameters. Delay and sensitivity are "
        "parameters of every model. The fractional model has the damping order as its fifth; the "
        "classical rivals with as many have the corner of a low-pass, or an answer to the "
        "acceleration's slope.")
    section.table(["sensor", "identify selects", "why"],
                  [[result.words, result.chosen, result.reason] for result in
                   study.bench.values()],
                  "What the package selects by itself from the noise record.")
    rows = []
    for name, found in study.diagnoses.items():
        causes = [f"{finding['cause']}: " + ", ".join(
            f"{parameter} {written(entry['value'], entry['std'], entry['unit'])}"
            for parameter, entry in finding["parameters"].items())
            for finding in found["findings"]]
        rows.append([study.bench[name].words, found["verdict"], "; ".join(causes) or "none"])
    section.table(["sensor", "verdict", "causes"], rows,
                  "What diagnose names from the same records, starting from a classical model "
                  "without a delay. True are the delay of 70 µs in all three, the order of 0.6 "
                  "in the second, and the corner of 2500 Hz in the third; none has an offset.")
    rows = []
    for result in study.bench.values():
        found = result.sampled
        poles = [f"{pole['natural_frequency_hz']['value']:.2f} Hz, "
                 f"{pole['damping_ratio']['value']:.4f}" for pole in found["poles"]]
        flat = found["substituted_error_percent"]
        rows.append([result.name, f"{100 * found['held_out_rms']:.2g}", "; ".join(poles),
                     f"{found['leading_coefficient']:.3g}", f"{min(flat):.4f} to {max(flat):.4f}"])
    section.table(["sensor", "error [%]", "poles in s", "b", "substituted: error [%]"], rows,
                  "A transfer function in z from the same records: its held-out error, its poles "
                  "(natural frequency and damping ratio) by s = rate · ln z, its leading "
                  "numerator coefficient b, and the paper's measure at 100 to 500 Hz if its "
                  "coefficients are put into an equation in s: 100 |1 − b| for any sensor.")
    section.text("The paper's own excitation on the same bench, a sine of 300 Hz, is refused: "
                 f"{study.refusal.split(';')[0]}." if study.refusal else
                 "The paper's own excitation, a sine of 300 Hz, is not refused.")


def _held_out(section, study):
    for result in study.bench.values():
        rows = []
        inside = result.frequency_hz <= 501
        for name, judged in result.judged.items():
            low, high = judged.rms_interval
            amplitude = 100 * np.abs(judged.error.real[inside]).max()
            phase = np.degrees(np.abs(judged.error.imag[inside])).max()
            rows.append([
                f"{name} ({result.fitted[name].parameters})", f"{100 * judged.rms:.3g}",
                f"{100 * low:.2g} to {100 * high:.3g}", f"{100 * judged.floor:.2g}",
                p_words(judged.p_value).removeprefix("p = ").removeprefix("p "),
                f"{amplitude:.2g}", f"{phase:.2g}", f"{100 * judged.beyond:.3g}",
                f"{judged.noise_ratio:.3g}", f"{judged.measure_percent:.3g}"])
        section.table(
            ["model", "error", "interval", "floor", "p", "ampl.", "phase [°]", "beyond", "/ noise",
             "measure"], rows,
            f"{sentence(result.words)} Models with their number of parameters; errors in percent. "
            "Error: RMS from 100 to 500 Hz, with its 95 % interval. Floor: what it would be by "
            "uncertainty alone; p: the probability that uncertainty gives as much. Ampl., phase: "
            "the largest there. Beyond: RMS from 600 to 1200 Hz. / noise: RMS of the samples' "
            "error over the noise's. Measure: the paper's, against the sensor.")
        series = {name: 100 * np.abs(judged.error) for name, judged in result.judged.items()}
        own = result.judged[FRACTIONAL]
        series["uncertainty (k = 2) of the fractional model's"] = 200 * np.sqrt(2) * own.std
        section.figure(
            figures.lines(result.frequency_hz, series, "frequency [Hz]", "relative error [%]",
                          log="y"),
            f"{sentence(result.words)} Held-out error of each model over frequency.")
        _amplitude_and_phase(section, result)


def _amplitude_and_phase(section, result):
    """Table of the errors of three models at each frequency."""
    shown = {CLASSICAL: "classical", FRACTIONAL: "fractional", rival(result)[0]: "rival"}
    rows = []
    for i, frequency in enumerate(result.frequency_hz):
        row = [f"{frequency:.0f}"]
        for name in shown:
            judged = result.judged[name]
            row.append(f"{100 * judged.error.real[i]:.3f} ± {200 * judged.std[i]:.3f}")
            row.append(f"{np.degrees(judged.error.imag[i]):.3f} ± "
                       f"{np.degrees(2 * judged.std[i]):.3f}")
        rows.append(row)
    heads = [text for name in shown.values() for text in (f"{name} [%]", "[°]")]
    section.table(["f [Hz]", *heads], rows,
                  f"{sentence(result.words)} Amplitude and phase errors with expanded "
                  f"uncertainties (k = 2). Rival: {rival(result)[0]}, the better one of the "
                  "classical models with as many parameters as the fractional one.")


def _swept(section, study):
    swept = {name: result for name, result in study.bench.items() if result.by_damping_order}
    orders = np.array([one.v1 for one in next(iter(swept.values())).by_damping_order])
    series = {result.words: np.array([np.nan if one.judged is None else 100 * one.judged.rms
                                      for one in result.by_damping_order])
              for result in swept.values()}
    section.text("Here the orders belong to the sensor's own equation, in s and with all other "
                 "parameters fitted anew for each; in the paper's sweep the coefficients stayed "
                 "those of z.")
    section.figure(figures.lines(orders, series, "damping order", "held-out error [%]", log="y"),
                   "The paper's sweep of one order, 0.94 to 2.08 in steps of 0.02, the other being "
                   f"2. {_missing(swept)}")
    rows = []
    for result in swept.values():
        one, both = best(result.by_damping_order), best(result.by_table_4)
        order, std = result.fitted[FRACTIONAL].order
        free = result.judged[FRACTIONAL]
        rows.append([result.words, f"{one.v1:g}", f"{100 * one.judged.rms:.3g}",
                     f"{both.v1:g} and {both.v2:g}", f"{100 * both.judged.rms:.3g}",
                     f"{order:.4f} ± {std:.1g}", f"{100 * free.rms:.3g}"])
    section.table(["sensor", "swept", "error [%]", "Table 4", "error [%]", "optimised",
                   "error [%]"], rows,
                  "Orders chosen by the smallest residual on the record that was fitted, and their "
                  "held-out errors: of the sweep, of the 64 combinations of the paper's Table 4, "
                  "and with the damping order as a free parameter.")
    for result in swept.values():
        _combinations(section, result)


def _combinations(section, result):
    """Table of the held-out errors over the paper's Table 4."""
    by_orders = {(one.v1, one.v2): one for one in result.by_table_4}
    first, second = (sorted({orders[i] for orders in by_orders}) for i in (0, 1))
    rows = []
    for v1 in first:
        cells = [by_orders.get((v1, v2)) for v2 in second]
        rows.append([f"{v1:g}", *("–" if one is None or one.judged is None else
                                  f"{100 * one.judged.rms:.2g}" for one in cells)])
    section.table(["order", *(f"{v2:g}" for v2 in second)], rows,
                  f"{sentence(result.words)} Held-out error [%] over the combinations of Table 4: "
                  "damping order down, inertia order across.")


def _missing(swept):
    """What is to be said of orders without a model."""
    without = sorted({one.v1 for result in swept.values() for one in result.by_damping_order
                      if one.judged is None})
    if not without:
        return ""
    return (f"Gaps, such as at {without[0]:g}: orders at which nothing is damped, or the model "
            "that fits best is unstable.")


def _map(section, study):
    section.text(
        f"The bench again and again, for sensors of order 0.5 to 1.5 and for a classical one "
        f"behind a low-pass, at {len(NOISE_DB)} noise levels and with {len(BANDS_HZ)} bandwidths "
        f"of the excitation, {SEEDS} records of 0.2 s each. These records come from the package's "
        "own simulation; the errors are against the true response at 100 to 500 Hz. Gain: the "
        "error of the best of the three classical models, chosen afterwards, over the fractional "
        "one's; above 1 the fractional one is better.")
    count = {verdict: sum(cell.verdict == verdict for cell in study.cells) for verdict in VERDICTS}
    section.table(["verdict", "cells", "meaning"],
                  [[verdict, str(count[verdict]), meaning] for verdict, meaning in
                   VERDICTS.items()], f"Verdicts on {len(study.cells)} cells of the map.")
    cells = {(cell.case.order, cell.case.lagging, cell.case.noise_db, cell.case.band_hz): cell
             for cell in study.cells}
    for band in BANDS_HZ:
        series = {_noise(noise): np.array([cells[order, False, noise, band].gain
                                                    for order in ORDERS]) for noise in NOISE_DB}
        series["no gain"] = np.ones(len(ORDERS))
        section.figure(
            figures.lines(np.array(ORDERS), series, "true damping order", "gain", log="y"),
            f"Gain over the true order; excitation up to {band:g} Hz, resonance at 650 Hz. "
            "Geometric mean of the records.")
        rows = []
        for order, lagging in [*((order, False) for order in ORDERS), (1.0, True)]:
            row = [f"{order:g}" + (" + low-pass" if lagging else "")]
            for noise in NOISE_DB:
                cell = cells[order, lagging, noise, band]
                low, high = cell.gain_interval
                row.append(f"{cell.verdict} ({factor(low)} to {factor(high)})")
            rows.append(row)
        section.table(["sensor's order", *map(_noise, NOISE_DB)], rows,
                      "Verdicts, and 95 % intervals of the gain's geometric mean over the records; "
                      f"excitation up to {band:g} Hz.")


def _noise(level_db):
    return f"noise {100 * 10**(-level_db / 20):g} %"
