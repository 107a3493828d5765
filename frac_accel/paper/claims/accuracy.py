"""Claims of section 3, of Table 1 and of the differences in Tables 2 and 3."""

import numpy as np

from .. import models, published, tables
from ..metric import (
    least_error_percent,
    median_error_percent,
    relative_error_percent,
    sampled_sines,
    start_phase_range_percent,
)
from .claim import ARTEFACT, CONFIRMED, CONTRADICTED, FOLLOWS, NOT_REPRODUCIBLE, Claim, listed

_FREQUENCY = np.array(published.FREQUENCY_HZ)
_SENSOR = np.array(published.TABLE_1_SENSOR_PERCENT)
_MODEL = np.array(published.TABLE_1_MODEL_PERCENT)
_FRACTIONAL = np.array(published.TABLE_2_FRACTIONAL_PERCENT)
_AT = published.FREQUENCY_HZ.index(published.IDENTIFIED_AT_HZ)


def peaks():
    """Why the relative error has peaks."""
    def largest(response):
        _, reference, output = sampled_sines(response, published.IDENTIFIED_AT_HZ, 0.1)
        error = relative_error_percent(reference, output)
        return float(np.nanmax(error)), float(np.nanmedian(error))
    sampled = tables.responses(models.identified())[_AT]
    small, shifted = largest(published.SENSITIVITY_EXAMINED_MV
                             / published.SENSITIVITY_REFERENCE_MV), largest(sampled / abs(sampled))
    return Claim(
        "peaks", "section 3, Figures 8 and 9",
        "The peaks of the relative error come from the examined sensor's low sensitivity: it shows "
        "zero where the reference is close to zero.",
        CONTRADICTED if shifted[0] > 5 * shifted[1] and small[0] < 1.001 * small[1] else CONFIRMED,
        "The relative error of one sine against another is singular where the reference crosses "
        "zero, if there is any phase between them. A low sensitivity alone makes no peaks; after "
        "the conversion into acceleration it has no effect at all.",
        f"A sine in phase with gain {published.SENSITIVITY_EXAMINED_MV:g}/"
        f"{published.SENSITIVITY_REFERENCE_MV:g}: error {small[0]:.1f} % at every sample. A sine "
        f"of the right amplitude with the phase of G(z) at 300 Hz: median {shifted[1]:.1f} %, "
        f"largest {shifted[0]:.0f} %.", {"low_sensitivity": small, "phase_alone": shifted})


def measure():
    """What the median measures."""
    sampled = tables.responses(models.identified())[_AT]
    turned = sampled / abs(sampled)
    ranges = {f: start_phase_range_percent(turned, f) for f in published.FREQUENCY_HZ}
    widest = max(ranges, key=lambda f: ranges[f][1] - ranges[f][0])
    low, high = ranges[widest]
    tangent = 100 * abs(np.sin(np.angle(turned)))
    return Claim(
        "measure", "section 3",
        "The median relative error is the measure of how well dynamic signals are reproduced.",
        CONTRADICTED if high - low > 1 else CONFIRMED,
        "For zero phase the median is |1 - gain|; with phase it grows whatever the gain, so that "
        "one number mixes gain and delay. It is also an order statistic of few distinct values: "
        "at 10 kHz a sine of 500 Hz is sampled at 20 phases, which the instant of the first sample "
        "chooses.",
        f"Gain 1 with the phase of G(z) at 300 Hz ({np.degrees(np.angle(turned)):.1f} deg) gives "
        f"{median_error_percent(turned, published.IDENTIFIED_AT_HZ):.1f} % at 300 Hz "
        f"(sine of the phase: {tangent:.1f} %). The same response at {widest:g} Hz gives "
        f"{low:.1f} to {high:.1f} %, depending on the phase of the first sample alone.",
        {"range_by_frequency": {str(f): r for f, r in ranges.items()}})


def larger_by():
    """Model against sensor at 300 Hz."""
    difference = float(_MODEL[_AT] - _SENSOR[_AT])
    agrees = abs(difference - published.MODEL_OVER_SENSOR_PERCENT) < 1.01e-4
    return Claim(
        "larger_by_0.3619", "section 3",
        "At 300 Hz the model's error is larger than the sensor's by 0.3619 %.",
        FOLLOWS if agrees else CONTRADICTED,
        "The difference of two cells of Table 1, in percentage points.",
        f"{_MODEL[_AT]} - {_SENSOR[_AT]} = {difference:.4f} points; "
        f"{100 * difference / _SENSOR[_AT]:.2f} % of the sensor's error.",
        {"difference_points": difference})


def sensor_column():
    """The sensor's errors."""
    natural = published.RESONANCE_4507_HZ
    own = 100 * ((_FREQUENCY / natural)**2 / (1 - (_FREQUENCY / natural)**2))
    return Claim(
        "table_1_sensor", "section 3, Table 1, column 2",
        "The sensor's relative error is 22.9 to 90.6 % between 100 and 500 Hz.",
        NOT_REPRODUCIBLE,
        "The signals are not published. An accelerometer whose resonance is at 18 kHz does not "
        "cause such errors; what did is not known.",
        f"An undamped 18 kHz sensor is wrong by {listed(own, 3)} % at the five frequencies.",
        {"printed": _SENSOR.tolist(), "resonance_percent": own.tolist()})


def model_column():
    """The model's errors."""
    response = tables.responses(models.identified())
    as_printed = tables.errors_percent(response)
    scale, scaled = tables.best_scale(response)
    least = [least_error_percent(np.angle(value), f) for value, f in zip(response, _FREQUENCY)]
    impossible = [int(f) for f, low, cell in zip(_FREQUENCY, least, _MODEL) if low > cell]
    return Claim(
        "table_1_model", "section 3, Table 1, column 3",
        "The relative error of the model G(z) is 30.8 to 26.0 % between 100 and 500 Hz.",
        NOT_REPRODUCIBLE if impossible else CONFIRMED,
        "It does not follow from G(z) as printed, with one scale factor for all frequencies or "
        "even with one for each: the phase alone makes the median larger. What else was done is "
        "not said.",
        f"G(z) as printed: {listed(as_printed)} %. With the scale factor that comes closest "
        f"({scale:.3f}): {listed(scaled)} %. Least that any amplitude and any phase of the first "
        f"sample can give with the phase of G(z): {listed(least)} %, more than the printed "
        f"{listed(_MODEL)} at {', '.join(map(str, impossible))} Hz.",
        {"as_printed": as_printed, "scale": scale, "scaled": scaled, "least": least,
         "impossible_at_hz": impossible})


def fit_and_table_1():
    """Figures 5 and 7 beside Table 1 at 300 Hz."""
    response = tables.responses(models.identified())[_AT]
    frequency = published.IDENTIFIED_AT_HZ
    as_printed = median_error_percent(response, frequency)
    least = least_error_percent(np.angle(response), frequency)
    cells = float(_SENSOR[_AT]), float(_MODEL[_AT])
    return Claim(
        "perfect_fit_and_table_1", "section 2, Figures 5 and 7, and Table 1",
        "At 300 Hz sensor and model have the same amplitude and phase, and their errors are "
        "29.1945 and 29.5564 %.",
        CONTRADICTED if least > min(cells) else CONFIRMED,
        "Both cannot be true of the printed G(z): if the sensor's signal were G(z)'s, its error "
        "would be G(z)'s as well. Which of the three is not what it is said to be cannot be told.",
        f"The error of G(z) at 300 Hz is {as_printed:.2f} %; with any other amplitude, and any "
        f"phase of the first sample, its phase alone gives at least {least:.2f} %. Same signals "
        f"would have the same error; the cells differ by {cells[1] - cells[0]:.4f} points.",
        {"as_printed": as_printed, "least": least, "cells": cells})


def other_frequencies():
    """Errors away from the identification frequency."""
    lower = [int(f) for f, error in zip(_FREQUENCY, _MODEL) if error < _MODEL[_AT]]
    return Claim(
        "worse_elsewhere", "section 3",
        "When the frequency is not that of the identification, the error values are higher.",
        CONTRADICTED if lower else CONFIRMED,
        "Table 1 itself: the model's error falls steadily with frequency.",
        f"Model's error {listed(_MODEL, 4)} %; lower than at 300 Hz at "
        f"{', '.join(map(str, lower)) or 'none'} Hz.", {"lower_at_hz": lower})


def growing_difference():
    """Difference between sensor and model over frequency."""
    difference = np.abs(_SENSOR - _MODEL)
    grows = bool(np.all(np.diff(difference[:_AT + 1]) < 0)
                 and np.all(np.diff(difference[_AT:]) > 0))
    return Claim(
        "growing_difference", "section 3",
        "The further the frequency from 300 Hz, the larger the difference between the medians of "
        "sensor and model.",
        FOLLOWS if grows else CONTRADICTED,
        "True of the printed cells on either side of 300 Hz. It follows from an identification at "
        "one frequency.",
        f"Absolute differences: {listed(difference, 4)} points.",
        {"difference_points": difference.tolist()})


def baselines():
    """What the differences of Tables 2 and 3 are taken from."""
    from_model = _MODEL - _FRACTIONAL
    from_sensor = _SENSOR - _FRACTIONAL
    worst = max(np.max(np.abs(from_model - published.TABLE_2_DIFFERENCE_PERCENT)),
                np.max(np.abs(from_sensor - published.TABLE_3_DIFFERENCE_PERCENT)))
    return Claim(
        "two_baselines", "section 4, Tables 2 and 3",
        "Both tables show by how much the error decreased in relation to the classical model.",
        CONTRADICTED if worst < 1.01e-4 else NOT_REPRODUCIBLE,
        "Two baselines under one heading: Table 2 subtracts from the classical model's error "
        "(Table 1, column 3), Table 3 from the sensor's (column 2). On that reading all ten "
        "differences follow, and Table 3 says nothing about the classical model.",
        f"Column 3 less 20.804: {listed(from_model, 4)}. Column 2 less 20.804: "
        f"{listed(from_sensor, 4)}. Largest deviation from the ten printed cells: {worst:.0e}.",
        {"worst": float(worst)})


def nearer_to_the_sensor():
    """Which model reproduces the sensor."""
    classical, fractional = np.abs(_SENSOR - _MODEL), np.abs(_SENSOR - _FRACTIONAL)
    nearer = [int(f) for f, a, b in zip(_FREQUENCY, classical, fractional) if b < a]
    return Claim(
        "reproduces_the_sensor", "sections 4 and 6",
        "The fractional order model reproduces the sensor's dynamic behaviour far more accurately.",
        CONTRADICTED if len(nearer) < len(_FREQUENCY) / 2 else CONFIRMED,
        "The measure compares the model with the reference, so that the best model would be the "
        "number 1. A model of the sensor must reproduce the sensor, errors included: its error "
        "must then be the sensor's (the converse need not hold).",
        f"Model's error less the sensor's, in points: classical {listed(classical, 4)}, fractional "
        f"{listed(fractional, 4)} (the differences of Table 3). The fractional model's is closer "
        f"at {', '.join(map(str, nearer)) or 'no'} Hz only.",
        {"classical": classical.tolist(), "fractional": fractional.tolist(),
         "nearer_at_hz": nearer})


def advantage_with_distance():
    """Whether the advantage grows with the distance from 300 Hz."""
    advantage = np.array(published.TABLE_2_DIFFERENCE_PERCENT)
    grows = bool(np.all(np.diff(advantage[:_AT + 1]) < 0) and np.all(np.diff(advantage[_AT:]) > 0))
    return Claim(
        "advantage_with_distance", "section 4",
        "The fractional model's advantage is the larger, the further the frequency is from 300 Hz.",
        CONFIRMED if grows else CONTRADICTED,
        "The fractional column is constant, so the advantage has the shape of the classical "
        "model's error, which falls with frequency.",
        f"Table 2: {listed(advantage, 4)} points at {listed(_FREQUENCY, 0)} Hz; at 400 and 500 Hz "
        "it is smaller than at 300 Hz.", {"advantage_points": advantage.tolist()})


def percent_or_points():
    """Percent of what."""
    advantage = np.array(published.TABLE_2_DIFFERENCE_PERCENT)
    relative = 100 * advantage / _MODEL
    return Claim(
        "percentage_decrease", "section 4",
        "The percentage decrease in the median error ranges from 5.2144 to 10.0049 %.",
        FOLLOWS if np.isclose([advantage.min(), advantage.max()],
                              published.DECREASE_PERCENT).all() else CONTRADICTED,
        "These are differences of two percentages, that is, percentage points.",
        f"As a decrease they would be {relative.min():.1f} to {relative.max():.1f} %.",
        {"relative_percent": relative.tolist()})


def constant_error():
    """The headline figure."""
    response = tables.responses(models.substituted())
    computed = np.array(tables.errors_percent(response))
    worst = float(np.max(np.abs(computed - _FRACTIONAL)))
    ranges = [start_phase_range_percent(value, f) for value, f in zip(response, _FREQUENCY)]
    coefficient = 100 * (1 - published.G_NUMERATOR[0])
    alone = abs(coefficient - _FRACTIONAL.mean()) < 1e-3
    return Claim(
        "constant_error", "section 4, Tables 2 and 3",
        "The fractional model's error is 20.8040 % at every frequency, constant to the third "
        "decimal, because its characteristic is so linear.",
        ARTEFACT if worst < 5e-4 and alone else NOT_REPRODUCIBLE,
        "Domain substitution: the coefficients of z in equation (6) were put into the equation "
        "(5) in s. There, above some hertz, the highest derivatives alone count, and the model is "
        "the constant gain 0.79196, the leading numerator coefficient of G(z).",
        f"Computed from sampled sines: {listed(computed, 4)} %. 100 (1 - 0.79196) = "
        f"{coefficient:.4f} %. (With another phase of the first sample than zero the sampled "
        f"median lies between {min(low for low, _ in ranges):.3f} and "
        f"{max(high for _, high in ranges):.3f} %.) No order in it is fractional: at v1 = 1 and "
        "v2 = 2 equation (5) is an ordinary differential equation.",
        {"computed": computed.tolist(), "worst": worst, "from_one_coefficient": coefficient})


CLAIMS = (peaks, measure, larger_by, sensor_column, model_column, fit_and_table_1,
          other_frequencies, growing_difference, baselines, constant_error, advantage_with_distance,
          percent_or_points, nearer_to_the_sensor)
