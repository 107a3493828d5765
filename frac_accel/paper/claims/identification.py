"""Claims of sections 1 and 2: the equation, the bench and the identified model."""

import numpy as np

from ...errors import IdentificationError
from ...identification.response.excitation import require_excitation
from ...model.core import Oscillator
from .. import models, published
from ..metric import sampled_sines
from ..tables import responses
from .claim import ARTEFACT, CONFIRMED, CONTRADICTED, NOT_REPRODUCIBLE, Claim, listed

# A damping order and a frequency to show the missing factor of equation (4) with.
_ORDER, _NATURAL_HZ = 0.5, 300.0
# Coefficients of G(z), which the excitation must suffice for.
_COEFFICIENTS = 4
# Damping ratio of a piezoelectric accelerometer, of the usual size; no claim depends on it.
_PIEZO_DAMPING = 0.02


def relative_motion():
    """Equations (1) to (3)."""
    s = 2j * np.pi * np.geomspace(1.0, 1e5, 50)
    omega, zeta = 2 * np.pi * _NATURAL_HZ, 0.3
    left = s * s + 2 * zeta * omega * s + omega**2
    absolute = (2 * zeta * omega * s + omega**2) / left
    worst = float(np.max(np.abs(absolute - 1 + s * s / left)))
    return Claim(
        "relative_motion", "section 1, equations (1) to (3)",
        "With w = y - x the equation of the absolute motion becomes that of the relative motion.",
        CONFIRMED if worst < 1e-12 else CONTRADICTED,
        "The two equations are the same.",
        f"Their transfer functions differ by at most {worst:.0e} from 1 Hz to 100 kHz.",
        {"worst": worst})


def equation_4():
    """Units of equation (4)."""
    omega = 2 * np.pi * _NATURAL_HZ
    # 2 zeta w0 (j w0)^v against 2 zeta w0^(2-v) (j w0)^v, in seconds and in milliseconds
    ratio = {name: float((omega * scale)**(_ORDER - 1))
             for name, scale in (("seconds", 1.0), ("milliseconds", 1e-3))}
    closes = bool(np.isclose(*ratio.values()))
    return Claim(
        "equation_4_units", "section 1, equation (4)",
        "A fractional damping is described by replacing the damping term of equation (3) by "
        "2 zeta w0 times the derivative of order v1.",
        CONFIRMED if closes else CONTRADICTED,
        "The factor w0^(1 - v1) is missing: the term must be 2 zeta w0^(2 - v1) D^v1. Without it "
        "zeta has a unit, and its value depends on the unit of time.",
        f"At v1 = {_ORDER} and a natural frequency of {_NATURAL_HZ:g} Hz the damping at resonance "
        f"is {ratio['seconds']:.4f} times 2 zeta with time in seconds and "
        f"{ratio['milliseconds']:.4f} times with time in milliseconds; with the factor it is "
        "2 zeta in both.", {"damping_over_2_zeta": ratio})


def resonance_out_of_reach():
    """Whether this bench could see the sensor's dynamics."""
    nyquist = published.SAMPLING_RATE_HZ / 2
    frequency = np.linspace(published.FREQUENCY_HZ[0], published.FREQUENCY_HZ[-1], 50)
    s = 2j * np.pi * frequency
    by_order = {order: Oscillator(published.RESONANCE_4507_HZ, _PIEZO_DAMPING, order)
                .transfer_function(s) for order in (0.5, 1.0, 1.5)}
    spread = max(float(np.max(np.abs(by_order[order] / by_order[1.0] - 1))) for order in (0.5, 1.5))
    return Claim(
        "dynamics_of_the_4507", "section 2",
        "Signals of 100 to 500 Hz, sampled at 10 kHz, serve to identify the dynamics of the 4507 "
        "sensor.",
        CONTRADICTED if published.RESONANCE_4507_HZ > nyquist else CONFIRMED,
        "The sensor's resonance (18 kHz by its data sheet) lies above the Nyquist frequency and "
        "36 times above the highest frequency used. What the signals show is the rest of the "
        "chain.",
        f"Nyquist frequency {nyquist:g} Hz. With a damping ratio of {_PIEZO_DAMPING}, a damping "
        f"order anywhere from 0.5 to 1.5 changes the response between 100 and 500 Hz by at most "
        f"{100 * spread:.2f} %.",
        {"nyquist_hz": nyquist, "largest_effect_of_order": spread})


def excitation():
    """One sine for four coefficients."""
    time_s, sine, output = sampled_sines(responses(models.identified())[2],
                                         published.IDENTIFIED_AT_HZ)
    try:
        require_excitation(sine, published.SAMPLING_RATE_HZ, _COEFFICIENTS)
        refusal = ""
    except IdentificationError as error:
        refusal = str(error).split(";")[0]
    rows = np.stack([output[1:-1], output[:-2], sine[2:], sine[1:-1]])
    singular = np.linalg.svd(rows @ rows.T, compute_uv=False)
    rank = int(np.sum(singular > 1e-9 * singular[0]))
    family = [_same_at_300(pole) for pole in (0.2, 0.8, 0.95)]
    spread = {str(int(f)): [float(abs(core(f))) for core in family]
              for f in published.FREQUENCY_HZ}
    return Claim(
        "one_sine", "section 2, equation (6)",
        "From one sine of 300 Hz the ARX method determines the transfer function G(z) with its "
        "four coefficients.",
        CONTRADICTED if rank < _COEFFICIENTS else CONFIRMED,
        "A sine is persistently exciting of order 2: it fixes amplitude and phase at its frequency "
        "and nothing else. Which of the many models comes out depends on noise and the solver.",
        f"The equations for the four coefficients have rank {rank}. Three other models of the same "
        "form, with the double pole at 0.2, 0.8 and 0.95, have exactly G(z)'s response at 300 Hz, "
        f"and gains of {listed(spread['100'])} at 100 Hz and {listed(spread['500'])} at 500 Hz, "
        f"where G(z) has {abs(responses(models.identified())[0]):.2f} and "
        f"{abs(responses(models.identified())[4]):.2f}. The package refuses such a record: "
        f"\"{refusal}\".",
        {"rank": rank, "coefficients": _COEFFICIENTS, "gains_of_equivalent_models": spread})


def _same_at_300(pole):
    """Response over frequency of a model with a double pole and G(z)'s response at 300 Hz."""
    def denominator(z):
        return (z - pole)**2

    def at(frequency):
        return np.exp(2j * np.pi * frequency / published.SAMPLING_RATE_HZ)
    z = at(published.IDENTIFIED_AT_HZ)
    wanted = responses(models.identified())[2] * denominator(z)
    powers = np.array([[(z * z).real, z.real], [(z * z).imag, z.imag]])
    b2, b1 = np.linalg.solve(powers, [wanted.real, wanted.imag])

    def response(frequency):
        z = at(frequency)
        return (b2 * z * z + b1 * z) / denominator(z)
    return response


def perfect_fit():
    """Figure 5's fit."""
    response = responses(models.identified())[2]
    _, sine, output = sampled_sines(response, published.IDENTIFIED_AT_HZ)
    regressors, output = np.stack([sine[1:], sine[:-1]], axis=1), output[1:]
    left = output - regressors @ np.linalg.lstsq(regressors, output, rcond=None)[0]
    share = float(np.std(left) / np.std(output))
    return Claim(
        "perfect_fit", "section 2, Figures 5 and 7",
        "The identified signal and the model's have the same amplitude and no phase shift.",
        ARTEFACT if share < 1e-9 else CONFIRMED,
        "Any model with two free coefficients fits one sine perfectly, whatever the sensor. The "
        "figure says nothing about other frequencies.",
        f"Two coefficients alone, those of the present and the last input sample, leave "
        f"{share:.1e} of the signal.", {"residual_over_signal": share})


def delay():
    """The phase of G(z)."""
    response = responses(models.identified())
    frequency = np.array(published.FREQUENCY_HZ)
    phase = np.degrees(np.angle(response))
    delays = -np.angle(response) / (2 * np.pi * frequency)
    sensor = Oscillator(published.RESONANCE_4507_HZ, _PIEZO_DAMPING)
    own = np.degrees(np.angle(sensor.transfer_function(2j * np.pi * frequency)))
    samples = delays * published.SAMPLING_RATE_HZ
    return Claim(
        "delay", "section 2, equation (6)",
        "G(z) is the transfer function of the 4507 sensor.",
        CONTRADICTED if np.min(delays) > 10 * np.max(-np.radians(own) / (2 * np.pi * frequency))
        else CONFIRMED,
        "A delay of about 1.7 samples, nearly constant over the band, is what a skew between the "
        "two channels or a filter in one conditioner causes; a sensor with a resonance at 18 kHz "
        "does not. Which of the two it was the paper does not let one tell.",
        f"Phase of G(z) at 100 to 500 Hz: {listed(phase)} deg, a delay of "
        f"{listed(1e6 * delays, 0)} us ({listed(samples)} samples). An 18 kHz sensor with a "
        f"damping ratio of {_PIEZO_DAMPING}: {listed(own, 3)} deg.",
        {"phase_deg": phase.tolist(), "delay_s": delays.tolist(), "delay_samples": samples.tolist(),
         "phase_of_an_18_khz_sensor_deg": own.tolist()})


def gain():
    """The gain of G(z)."""
    response = np.abs(responses(models.identified()))
    static = models.identified().reference_gain()
    ratio = published.SENSITIVITY_EXAMINED_MV / published.SENSITIVITY_REFERENCE_MV
    units = {"volts to volts": ratio, "its inverse": 1 / ratio, "acceleration to acceleration": 1.0}
    nearest = min(units.values(), key=lambda value: abs(np.log(response[2] / value)))
    follows = abs(response[2] / nearest - 1) < 0.05
    return Claim(
        "gain", "section 2, equation (6)",
        "The voltages were converted into acceleration, and G(z) relates the two.",
        CONFIRMED if follows else NOT_REPRODUCIBLE,
        "The gain is none that the printed sensitivities give. Whether it comes from the "
        "conditioners' gains, the conversion or the fit cannot be told.",
        f"Gain of G(z): {static:.3f} at rest, {response[2]:.3f} at 300 Hz. The sensitivities give "
        f"{ratio:.4f} for volts, {1 / ratio:.1f} the other way round, and 1 for acceleration.",
        {"gain": response.tolist(), "static_gain": static, "expected": units})


def no_oscillator():
    """The poles of G(z)."""
    core = models.identified()
    poles, zeros = core.poles(), np.roots(core.numerator)
    real = bool(np.all(np.abs(poles.imag) < 1e-9 * np.abs(poles)))
    corners = np.sort(np.abs(poles.real)) / (2 * np.pi)
    negative = float(np.min(zeros.real))
    return Claim(
        "no_oscillator", "sections 1 and 2, equations (1) and (6)",
        "The model of second order is that of the oscillating mass of equation (1).",
        CONTRADICTED if real else CONFIRMED,
        "G(z) has no resonance: it is two lags in a row. With one sine as its source its poles say "
        "nothing about the sensor.",
        f"Poles mapped by s = f_s ln z are real: lags with corners at {listed(corners, 0)} Hz. A "
        f"zero at z = {negative:.4f} has no counterpart in continuous time.",
        {"poles_rad_s": [complex(p).real for p in poles], "corner_hz": corners.tolist()})


CLAIMS = (relative_motion, equation_4, resonance_out_of_reach, excitation, perfect_fit, delay,
          gain, no_oscillator)
