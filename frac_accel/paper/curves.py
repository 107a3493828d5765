"""Figures 3 and 8 to 17 again: curves of the models that the paper names."""

import dataclasses

import numpy as np

from . import models, published
from .metric import relative_error_percent, sampled_sines

_POINTS = 80
PICTURE = "computed; the paper shows a picture without numbers"


@dataclasses.dataclass(frozen=True)
class Figure:
    """A figure of the paper.

    Attributes
    ----------
    title, status, remark : str
    x : ndarray, shape (m,)
        Frequency [Hz], or time [s] in Figures 8 and 9.
    series : dict of str to dict
        Name of each curve -> ``magnitude_db`` and ``phase_deg``, or ``relative_error_percent``.
    """

    title: str
    status: str
    remark: str
    x: np.ndarray
    series: dict


def orders():
    """Orders of section 4: 0.94 to 2.08 in steps of 0.02."""
    count = round((published.ORDERS_LAST - published.ORDERS_FIRST) / published.ORDERS_STEP) + 1
    return tuple(round(published.ORDERS_FIRST + i * published.ORDERS_STEP, 2)
                 for i in range(count))


def figures():
    """The figures, by their numbers.

    Returns
    -------
    dict of str to Figure
    """
    sampled = _frequencies(1.0, 0.4999 * published.SAMPLING_RATE_HZ)
    wide, low = _frequencies(1e-3, 1e4), _frequencies(0.1, 1e3)
    classical, plain = models.identified(), models.substituted()
    v2 = {f"v2 = {order:g}": models.substituted(1.0, order) for order in orders()}
    v1 = {f"v1 = {order:g}": models.substituted(order, 2.0) for order in published.TABLE_4_V1}
    both = {"equation (5), orders 1 and 2": plain, "equation (6), G(z)": classical}
    told = told_of_figure_16()
    return {
        "3": _bode("Amplitude and phase of the sensor's model", sampled,
                   {"equation (6), G(z)": classical}),
        "8": _errors("Relative error over time, 300 Hz", 0.02),
        "9": _errors("The same in a changed scale", 0.02),
        "10": _bode("Different v2", wide, v2),
        "11": _bode("Different v2 in a changed scale", low, v2),
        "12": _bode("v2 = 2 and the classical notation", sampled, both),
        "13": _bode("Changed v1", wide, v1),
        "14": _bode("v1 = 1 and the classical notation", sampled, both),
        "15": _bode("The same, enlarged", _frequencies(50.0, 1000.0), both),
        "16": _bode("v1 = 1 and v2 = 2", wide, {"equation (5), orders 1 and 2": plain},
                    _told(told), told["remark"]),
        "17": _bode("The same, enlarged", low, {"equation (5), orders 1 and 2": plain},
                    _told(told), told["remark"]),
    }


def told_of_figure_16():
    """What the text tells of Figures 16 and 17, and what equation (5) gives there."""
    told = published.FIGURE_16
    at = np.array([told["flat_from_hz"], 1.0])
    response = models.substituted().transfer_function(2j * np.pi * at)
    magnitude = 20 * np.log10(np.abs(response))
    phase = np.degrees(np.abs(np.angle(response)))
    return {"magnitude_db": float(magnitude[0]), "phase_at_flat_from_deg": float(phase[0]),
            "magnitude_at_1_hz_db": float(magnitude[1]), "phase_at_1_hz_deg": float(phase[1]),
            "reproduced": bool(abs(magnitude[0] - told["magnitude_db"]) < 0.005
                               and abs(phase[1] - told["phase_at_1_hz_deg"]) < 5e-4),
            "remark": f"told: {told['magnitude_db']} dB at {told['flat_from_hz']} Hz, phase at "
                      f"most {told['largest_phase_deg']} deg, {told['phase_at_1_hz_deg']} deg at "
                      f"1 Hz; computed: {magnitude[0]:.2f} dB and {phase[0]:.1f} deg at "
                      f"{told['flat_from_hz']} Hz, {phase[1]:.1f} deg at 1 Hz"}


def _told(told):
    return "reproduced" if told["reproduced"] else \
        "not reproducible: the coefficients as printed give other values at low frequencies"


def _frequencies(low, high):
    return np.geomspace(low, high, _POINTS)


def _bode(title, frequency, cores, status=PICTURE, remark=""):
    series = {}
    for name, core in cores.items():
        response = core.transfer_function(2j * np.pi * frequency)
        series[name] = {"magnitude_db": 20 * np.log10(np.abs(response)),
                        "phase_deg": np.degrees(np.unwrap(np.angle(response)))}
    return Figure(title, status, remark, frequency, series)


def _errors(title, duration_s):
    frequency = published.IDENTIFIED_AT_HZ
    at = np.array([2j * np.pi * frequency])
    sampled = models.identified().transfer_function(at)[0]
    shown = {"equation (6), scaled to gain 1": sampled / abs(sampled),
             "equation (5), orders 1 and 2": models.substituted().transfer_function(at)[0]}
    series = {}
    for name, response in shown.items():
        # a start between two zero crossings: the paper's is not known
        time_s, reference, output = sampled_sines(response, frequency, 0.1, duration_s)
        series[name] = {"relative_error_percent": relative_error_percent(reference, output)}
    return Figure(title, "not reproducible: the sensor's raw signals are not published",
                  "the peaks at each zero crossing of the reference are those of any sine that is "
                  "shifted against another", time_s, series)
