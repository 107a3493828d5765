"""The motion behind a recorded reference that has faults of its own."""

import numpy as np

from ..io.samples import Samples
from ..model import AXES, AxisModel
from ..model.core import Gain
from ..record import Record
from ..signals.convolution import Convolution
from ..simulation import AxisSimulator, simulate, static_gain

# Share of the larger of two answers from which the smaller one is seen.
_SEEN = 1e-6


def restored(reference, sensor, model, axis="x", temperature_at=None):
    """Reference without the `reference_faults` of a model.

    What a high-pass has taken away for good, a constant and a slow drift, is taken from the
    sensor: those with which the simulated output comes nearest to the measured one.

    Parameters
    ----------
    reference, sensor : Samples
    model : SensorModel
    axis : {"x", "y", "z"}
        The axis whose sensor tells the drift; the others keep theirs.
    temperature_at : callable, optional
        Temperature [°C] at an array of stamps [ns].

    Returns
    -------
    Samples
        At uniform instants; the reference itself where the model names no faults.

    Raises
    ------
    FracAccelError
        If no pair can be made of the samples.
    """
    if not model.reference_faults:
        return reference
    pair = Record.of(reference, sensor, axis)
    rate, column = pair.sampling_rate_hz, AXES.index(axis)
    time = np.arange(len(pair)) / rate
    values = np.empty_like(pair.reference)
    links, on_base = AxisModel(Gain(), model.reference_faults).behind_base
    for i, recorded in enumerate(pair.reference.T):
        for fault in on_base:
            if i == column or not fault.of_own_axis:
                recorded = fault.change_base(recorded, rate)
        convolution = Convolution(recorded - recorded[0], rate)
        values[:, i] = convolution.response(links.transfer_function(convolution.s)) + recorded[0]
    early_s = -sum(fault.pure_delay_s() for fault in model.reference_faults)
    if any(pole == 0 for fault in model.reference_faults for pole in fault.poles()):
        celsius = temperature_at(pair.start_ns + np.round(1e9 * time)) if temperature_at else None
        output = simulate(model, values, rate, initial="steady", temperature_c=celsius,
                          start_time_s=pair.start_time_s)[:, column]
        # the sensor's instants are later than the restored reference's
        output = np.interp(time + pair.lag_s + early_s, time, output)
        drift = np.stack([np.ones(len(time)), time / time[-1]], axis=1)
        answers = _answers(model.axis(axis), drift, rate)
        lost = np.linalg.lstsq(answers[pair.valid], (pair.sensor[:, column] - output)[pair.valid],
                               rcond=_SEEN)[0]
        values[:, column] += drift @ lost
    stamps = pair.start_ns + np.round(1e9 * (time - early_s)).astype(np.int64)
    return Samples.of(stamps, values, frame_id=reference.frame_id)


def _answers(own, drift, rate):
    """What a sensor makes of a drift, shape (n, 2)."""
    gain = static_gain(own)
    if gain:
        return gain * drift
    return np.stack([AxisSimulator(each, rate).respond(own) for each in drift.T], axis=1)
