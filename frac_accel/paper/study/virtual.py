"""Virtual records of the bench by the package's own simulation, for the map.

They repeat the bench over orders, noise levels and bandwidths, far more often than records could
be kept. The package's simulation and its fits share the equation of motion, so what the map tells
is what noise, bandwidth and the model's form do; that the simulation is right is shown elsewhere,
on records of an independent simulator.
"""

import dataclasses

import numpy as np

from ...model import SensorModel
from ...model.core import Oscillator
from ...model.effects import identified_effect
from ...model.effects.low_pass_lag import LowPassLag
from ...simulation import simulate
from .. import published
from .candidates import AS_MANY, FRACTIONAL, fit_all
from .judge import rms

# The bench's sensor and card, as in the recorded bags.
NATURAL_HZ, DAMPING, DELAY_S, CORNER_HZ = 650.0, 0.12, 70e-6, 2500.0
STEP = 2.0**-7
LEVEL = 30.0
LOWEST_HZ = 10.0
# Where models are judged: the paper's frequencies, and beyond.
INSIDE_HZ = np.array(published.FREQUENCY_HZ)
BEYOND_HZ = np.array([600.0, 700.0, 850.0, 1000.0, 1200.0])
_SAMPLES, _LEAD = 2048, 512


@dataclasses.dataclass(frozen=True)
class Case:
    """One virtual record.

    Attributes
    ----------
    order : float
        True damping order.
    lagging : bool
        Whether a low-pass of the conditioner follows that no model but one knows of.
    noise_db : float
        Level of the output over its noise.
    band_hz : float
        Upper end of the noise that the sensor is identified from.
    seed : int
    """

    order: float
    lagging: bool
    noise_db: float
    band_hz: float
    seed: int

    def truth(self):
        """SensorModel that makes the record."""
        links = [LowPassLag(CORNER_HZ)] if self.lagging else []
        return SensorModel(Oscillator(NATURAL_HZ, DAMPING, self.order),
                           [*links, identified_effect("delay_s", DELAY_S)])

    def record(self):
        """Reference and sensor, shape (n,) each, from mid-motion."""
        rng = np.random.default_rng([self.seed, round(100 * self.order), round(self.noise_db),
                                     round(self.band_hz), self.lagging])
        rate, n = published.SAMPLING_RATE_HZ, _SAMPLES + _LEAD
        frequency = np.fft.rfftfreq(2 * n, 1 / rate)
        spectrum = np.where((frequency > LOWEST_HZ) & (frequency < self.band_hz),
                            rng.normal(size=(len(frequency), 2)) @ [1, 1j], 0)
        reference = np.fft.irfft(spectrum)[:n]
        reference *= LEVEL / reference.std()
        clean = simulate(self.truth(), reference, rate, axis="x")
        noise = clean.std() * 10**(-self.noise_db / 20) * rng.normal(size=n)
        reference, sensor = (STEP * np.round(values / STEP) for values in
                             (reference, clean + noise))
        return reference[_LEAD:], sensor[_LEAD:]


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What the candidates made of a virtual record.

    Attributes
    ----------
    case : Case
    inside, beyond : dict of str to float
        RMS relative error of each candidate's response, amplitude and phase together, at the
        paper's frequencies and beyond. Without those that could not be fitted.
    residual : dict of str to float
        RMS of each fit's residual over the output's standard deviation.
    floor : float
        Error that the fractional fit's uncertainty alone would give inside.
    order, order_std : float
        Damping order that the fractional fit found.
    """

    case: Case
    inside: dict
    beyond: dict
    residual: dict
    floor: float
    order: float
    order_std: float

    @property
    def rival(self):
        """Smallest error of the classical models with as many parameters as the fractional one.

        The best one afterwards: no rule of choice could do better for the classical side.
        """
        return min(self.inside[name] for name in AS_MANY if name in self.inside)

    @property
    def significant(self):
        """Whether the order differs from 1 by more than three standard uncertainties."""
        return abs(self.order - 1) > 3 * self.order_std


def outcome(case, record=None):
    """Fit all candidates to the record of a case, and compare them with the truth.

    Parameters
    ----------
    case : Case
    record : tuple of two ndarray, optional
        Reference and sensor instead of `Case.record`, such as those of another simulator.

    Returns
    -------
    Outcome
    """
    reference, sensor = case.record() if record is None else record
    truth = case.truth()
    inside, beyond, residual = {}, {}, {}
    floor = order = order_std = float("nan")
    for name, found in fit_all(reference, sensor, published.SAMPLING_RATE_HZ).items():
        for errors, frequency in ((inside, INSIDE_HZ), (beyond, BEYOND_HZ)):
            errors[name] = rms(found.response(frequency) / truth.frequency_response(frequency) - 1)
        residual[name] = float(found.fit.rmse / sensor.std())
        if name == FRACTIONAL:
            order, order_std = found.order
            floor = float(np.sqrt(np.trace(found.relative_covariance(INSIDE_HZ)) / len(INSIDE_HZ)))
    return Outcome(case, inside, beyond, residual, floor, order, order_std)

