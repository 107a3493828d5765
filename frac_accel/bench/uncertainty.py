"""Uncertainty at sensor rate, beside PyDynamic on the same filter."""

import time

import numpy as np

from ..correction.parameter_uncertainty import ParameterUncertaintyState
from ..model import SensorModel
from ..streaming import Corrector
from ..uncertainty import UncertainFilter
from .figures import Figure
from .passage import model_document

_SAMPLES = 100_000
_PEER_SAMPLES = 2000
_PEER = "PyDynamic.uncertainty.IIRuncFilter"


def accelerometer_filter():
    """Second-order digital filter of PyDynamic's accelerometer example, with its covariance.

    The bilinear transform of the sensor with 36 kHz, damping 0.0055, at 500 kHz; its coefficients'
    covariance to first order from 1 % on the frequency, 10 % on the damping, 0.1 % on the gain.
    """
    values = np.array([36e3, 0.0055, 0.124])

    def coefficients(values):
        frequency_hz, damping, gain = values
        k, w = 2 * 500e3, 2 * np.pi * frequency_hz
        a0 = k**2 + 2 * damping * w * k + w**2
        a = np.array([2 * (w**2 - k**2), k**2 - 2 * damping * w * k + w**2]) / a0
        return np.r_[a, gain * w**2 / a0 * np.array([1.0, 2.0, 1.0])]

    slopes = np.stack([(coefficients(values + step) - coefficients(values - step)) / 2e-6
                       for step in np.eye(3) * values * 1e-6], axis=1)
    root = slopes * np.array([0.01, 0.1, 0.001])
    theta = coefficients(values)
    return theta[2:], np.r_[1.0, theta[:2]], root @ root.T


class Settable(np.ndarray):
    """PyDynamic assigns arrays of one element to elements, which numpy 2.4 refuses."""

    def __setitem__(self, key, value):
        super().__setitem__(key, np.asarray(value).item())


def run(rounds):
    """Figures of the sensitivity filters and of the filter with uncertain coefficients."""
    figures = _sensitivity_filters(rounds)
    b, a, covariance = accelerometer_filter()
    rng = np.random.default_rng(0)
    values, std = rng.normal(size=_SAMPLES), np.full(_SAMPLES, 1e-3)

    def ours(count):
        uncertain = UncertainFilter(b, a, covariance, level=values[0], input_std=std[0])
        return uncertain.process(values[:count], std[:count])

    own_us = shortest_us(lambda: ours(_SAMPLES), _SAMPLES, rounds)
    figures.append(Figure("uncertainty", "uncertain second-order filter, time per sample", own_us,
                          "us", most=0.2))
    try:
        from PyDynamic.uncertainty.propagate_filter import IIRuncFilter
    except ImportError:
        return figures

    def theirs():
        return IIRuncFilter(values[:_PEER_SAMPLES].view(Settable), std[:_PEER_SAMPLES], b, a,
                            Uab=covariance, kind="diag")

    their_us = shortest_us(theirs, _PEER_SAMPLES, rounds)
    output, uncertainty, _ = theirs()
    own_output, own_uncertainty = ours(_PEER_SAMPLES)
    apart = max(np.max(np.abs(own_output - output)) / np.max(np.abs(output)),
                np.max(np.abs(own_uncertainty / uncertainty - 1)))
    return [*figures,
            Figure("uncertainty", "the same filter in PyDynamic, time per sample", their_us, "us",
                   peer=_PEER),
            Figure("uncertainty", "PyDynamic's time over ours", their_us / own_us, "", least=300,
                   peer=_PEER),
            Figure("uncertainty", "largest relative difference to PyDynamic", apart, "", most=1e-9,
                   peer=_PEER)]


def _sensitivity_filters(rounds):
    """Time that the parameters' uncertainty adds to the correction, per sample and axis."""
    rate_hz = 10_000.0
    values = np.random.default_rng(0).normal(size=(3, 4096))
    figures = []
    for share, block in ((0.15, 4096), (0.15, 32), (0.02, 4096)):
        model = SensorModel.from_dict(model_document(rate_hz, share))
        design = Corrector(model, rate_hz, noise_std=0.01).design

        def one(design=design.parameter_uncertainty[0], block=block):
            state = ParameterUncertaintyState(design, np.zeros(3))
            for start in range(0, 4096, block):
                state.process(values[:, start:start + block])

        figures.append(Figure(
            "uncertainty", f"fractional inverse of {len(design.axes[0].filter.taps)} taps, 4 "
            f"uncertain parameters, blocks of {block}: time per sample and axis",
            shortest_us(one, 3 * 4096, 5 * rounds), "us", most=0.2 if block > 1000 else None))
    return figures


def shortest_us(function, count, repeats):
    """Shortest processor time of some runs, over a count [us]."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        function()
        times.append(time.process_time() - start)
    return 1e6 * min(times) / count
