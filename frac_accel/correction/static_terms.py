r"""What a nonlinear spring adds to the inverse of a sensor.

The equation of motion is explicit in the output q, so that the inverse is a filter and a static
map:

.. math:: a = L^{-1} q + N(q, q') / S

with the linear core L. The filter runs on the raw samples; this path makes q from them, between
the samples, too (else the harmonics that N makes would fold back into the band), applies N and lets
its result through the same band with the same delay.
"""

import dataclasses

import numpy as np

from ..errors import DesignError
from ..model.core.bouc_wen import follow_one_way
from ..model.effects.base import CORE
from ..signals.linear_filter import run_sections
from ..signals.parallel_filter import FilterState, ParallelFilter
from .fitting import FilterProblem

# Points at which q is made in each sampling interval: the third harmonic of 0.6 of the Nyquist
# frequency, and its mirror image, then lie outside the band.
POINTS = 4
# q is made up to this share of the Nyquist frequency, or where a low-pass leaves this much gain.
_TOP = 0.7
_LEAST_GAIN = 0.2
# Worst relative errors; N itself is a small part of the signal.
_TOLERANCE = 2e-3
_BAND_TOLERANCE = 5e-3
# Parts of N that come with a coefficient each, and the powers of q, which do, too.
FRICTION, HYSTERESIS = PARTS = "friction", "hysteresis"
# Powers of the output in a spring's force.
POWERS = (2, 3)
# Bouc-Wen variable [output units] beyond which a spike has taken an unbounded branch along.
_LARGEST_Z = 1e12
_DELAYS = (6, 8, 12, 16, 24, 32, 48, 64)


@dataclasses.dataclass(frozen=True, eq=False)
class StaticTerms:
    """Path of an axis's `StaticForce` into the corrected signal.

    Attributes
    ----------
    force : StaticForce
    phases : tuple of ParallelFilter
        From samples to q, at each of the `POINTS` instants of an interval.
    band : ParallelFilter
        From N at those instants to what is added to the corrected signal.
    output_noise, velocity_noise : float
        Standard deviation of q, and of half its change over two instants, per standard deviation
        of white noise of the samples.
    step : float
        Time between two of the instants, times the natural angular frequency.
    own_noise, common_noise : float
        Square of the noise gain of this path for a force of slope one, and its product with the
        linear filter's.
    is_coupled : bool
        Whether the sensor knows nothing of a steady q.
    """

    force: object
    phases: tuple
    band: ParallelFilter
    output_noise: float
    velocity_noise: float
    step: float
    own_noise: float
    common_noise: float
    is_coupled: bool

    @property
    def warm_up_samples(self):
        """Samples until both stages are full."""
        first = max(phase.lead + len(phase.taps) for phase in self.phases)
        return first + -(-(self.band.lead + len(self.band.taps) + 2) // POINTS)


class StaticTermsDesign:
    """Both stages for one axis; the delay is shared between them.

    Parameters
    ----------
    axis : AxisModel
    rate : float
        Sampling rate [Hz].
    band : tuple of float
        Of the correction [Hz].
    late : float
        Delay [samples] that this axis has beyond the common one.
    """

    def __init__(self, axis, rate, band, late):
        self._axis, self._rate = axis, rate
        behind = [link for link in axis.dynamics[1:] if link.stage > CORE]
        before = [link for link in axis.dynamics[1:] if link.stage < CORE]

        def to_output(s):
            return 1 / np.prod([np.ones_like(s), *(link.transfer_function(s) for link in behind)],
                               axis=0)

        def to_base(s):
            return 1 / (axis.effective_core.sensitivity * np.prod(
                [np.ones_like(s), *(link.transfer_function(s) for link in before)], axis=0))

        grid = np.linspace(0.02, _TOP, 50) * rate / 2
        gain = 1 / np.abs(to_output(2j * np.pi * grid))
        top = grid[np.flatnonzero(gain >= _LEAST_GAIN * gain.max())[-1]]
        zeros = np.concatenate([np.empty(0), *(link.zeros() for link in behind)])
        self.is_coupled = bool((zeros == 0).any())
        low = band[0] if self.is_coupled else 0.0
        self._phases = [FilterProblem(to_output, zeros, rate, (low, max(top, 1.1 * band[1])),
                                      late - point / POINTS) for point in range(POINTS)]
        self._band = FilterProblem(to_base, np.empty(0), POINTS * rate, (0.0, band[1]), 0)
        self.first_delay, self._filters = self._shortest(
            lambda delay: [phase.solve(delay, _TOLERANCE) for phase in self._phases], _TOLERANCE)
        second, _ = self._shortest(
            lambda delay: [self._band.solve(POINTS * delay - 1, _BAND_TOLERANCE)], _BAND_TOLERANCE)
        self.least_delay = self.first_delay + second

    def _shortest(self, solve, tolerance):
        for delay in _DELAYS:
            filters = solve(delay)
            error = max(max(f.amplitude_error, np.radians(f.phase_error_deg)) for f in filters)
            if error <= tolerance:
                return delay, filters
        raise DesignError(f"the nonlinear terms cannot be corrected up to "
                          f"{self._phases[0].band[1]:.4g} Hz at {self._rate:.6g} Hz: an error of "
                          f"{error:.2g} remains; ask for a smaller bandwidth")

    def solve(self, delay, linear):
        """`StaticTerms` for a total delay [samples], beside the linear DesignedFilter."""
        # the force at an instant needs the one after it
        band = self._band.solve(POINTS * (delay - self.first_delay) - 1, _BAND_TOLERANCE).filter
        phases = tuple(f.filter for f in self._filters)
        length = max(len(phase.taps) for phase in phases) + len(band.taps) // POINTS + 8
        impulse = np.zeros((1, length + linear.filter.lead + len(linear.filter.taps)))
        impulse[0, 0] = 1.0
        fine = _between(phases, impulse, np.zeros(1))[0]
        change = np.r_[0.0, (fine[2:] - fine[:-2]) / 2, 0.0]
        own = _run(band, np.roll(fine, 1)[None])[0][::POINTS]
        main = _run(linear.filter, impulse)[0]
        return StaticTerms(
            force=self._axis.static_force, phases=phases, band=band, is_coupled=self.is_coupled,
            output_noise=_loudest(fine), velocity_noise=_loudest(change),
            step=2 * np.pi * self._axis.static_force.natural_frequency_hz / (POINTS * self._rate),
            own_noise=float(np.sum(own**2)), common_noise=float(np.sum(own * main)))


def coefficients(axis, nominal):
    """Coefficients of the parts of N / S in another AxisModel, for the nominal one's q and S.

    Sensitivity and gain move all of them.

    Returns
    -------
    dict
        By power of q, or of `PARTS`.
    """
    force = axis.static_force
    share = nominal.effective_core.sensitivity / axis.effective_core.sensitivity
    behind, nominally = (np.prod([effect.reference_gain() for effect in one.effects
                                  if effect.stage > CORE]) for one in (axis, nominal))
    result = {power: share * value * (nominally / behind)**power
              for power, value in enumerate(force.polynomial, POWERS[0])}
    return {**result, FRICTION: share * force.friction_level, HYSTERESIS: share * force.strength}


def _loudest(fine):
    """Noise gain of the loudest of the interleaved phases."""
    return float(np.sqrt(np.sum(fine.reshape(-1, POINTS)**2, axis=0).max()))


def _run(parallel_filter, values):
    """Response from rest, (k, n); a sensor far below the rate has taps by the ten thousand."""
    count = values.shape[1]
    late = np.pad(values, ((0, 0), (parallel_filter.lead, 0)))[:, :count]
    taps, chains = parallel_filter.chains
    length = 1 << (count + len(taps)).bit_length()
    result = np.fft.irfft(np.fft.rfft(late, length) * np.fft.rfft(taps, length), length)[:, :count]
    for chain in chains:
        result += run_sections(chain, late, np.zeros((len(values), len(chain), 2)))
    return result


def _between(phases, values, level):
    states = [FilterState(phase, level) for phase in phases]
    return _interleaved([state.process(values) for state in states])


def _interleaved(parts):
    return np.stack(parts, axis=2).reshape(len(parts[0]), -1)


class StaticTermsState:
    """`StaticTerms` of some axes running over their samples, in blocks of any length.

    Parameters
    ----------
    terms : StaticTerms
    level : ndarray, shape (k,)
        The samples of each axis before the first: a constant.
    parts : tuple
        Of `PARTS`, or powers of q: those that are wanted one by one, too.
    elapsed_s : float
        Time [s] of the first sample since the record's start.
    """

    def __init__(self, terms, level, parts=(), elapsed_s=0.0):
        self._terms = terms
        self._states = [FilterState(phase, level) for phase in terms.phases]
        gain = terms.phases[0].static_gain
        steady = np.repeat((gain * level)[:, None], 2, axis=1)
        # q and its noise at the last two instants
        self._last, self._last_noise = steady, np.zeros_like(steady)
        force = _power_terms(terms.force.polynomial, steady[:, 0])
        self._band = FilterState(terms.band, force)
        self._parts = {part: FilterState(terms.band, steady[:, 0]**part if part in POWERS
                                         else np.zeros(len(level))) for part in parts}
        self._z, self._before = np.zeros(len(level)), steady[:, 0].copy()
        # state of each further law, and where and how fast the mass was before
        natural = 2 * np.pi * terms.force.natural_frequency_hz if terms.force.laws else 0.0
        self._laws = [[(natural * elapsed_s if law.timed else 0.0, (start, 0.0))
                       for start in steady[:, 0]] for law in terms.force.laws]
        weight = np.abs(terms.band.taps)
        rest = np.zeros(len(level))
        spread = dataclasses.replace(terms.band, taps=weight)
        self._slope = FilterState(
            dataclasses.replace(terms.band, taps=weight / weight.sum()), rest)
        self._doubt = FilterState(spread, rest)

    def process(self, values, variance):
        """What the spring adds to the corrected samples.

        Parameters
        ----------
        values, variance : ndarray, shape (k, n)
            Samples, and their noise.

        Returns
        -------
        added, variance : ndarray, shape (k, n)
            With the variance that it brings.
        parts : list of ndarray, shape (k, n)
            What each of the wanted parts adds with a coefficient of one.
        """
        terms = self._terms
        fine = _interleaved([state.process(values) for state in self._states])
        noise = np.repeat(np.sqrt(variance), POINTS, axis=1)
        q = np.concatenate([self._last, fine], axis=1)
        spread = np.concatenate([self._last_noise, noise], axis=1)
        self._last, self._last_noise = q[:, -2:], spread[:, -2:]
        here = q[:, 1:-1]
        force, doubt, parts = self._force(here, (q[:, 2:] - q[:, :-2]) / 2,
                                          q[:, 2:] - 2 * here + q[:, :-2],
                                          spread[:, 1:-1])
        # of the linear noise, this path repeats or cancels a part
        slope = self._slope.process(_slope(terms.force.polynomial, here))[:, ::POINTS]
        added = variance * (2 * slope * terms.common_noise + slope**2 * terms.own_noise)
        added += self._doubt.process(doubt)[:, ::POINTS]**2
        parts = [state.process(here**part if part in POWERS else parts[part])[:, ::POINTS]
                 for part, state in self._parts.items()]
        return self._band.process(force)[:, ::POINTS], added, parts

    def _force(self, q, change, bend, noise):
        """N at the instants, the standard deviation of what is not known of it, and its `PARTS`.

        change, bend : first and second difference of q; noise : standard deviation of the samples'.
        """
        force = self._terms.force
        change_noise = self._terms.velocity_noise * noise
        total = _power_terms(force.polynomial, q)
        doubt, parts = np.zeros_like(q), {}
        if force.friction_level:
            # of a velocity that turns between two instants, the mean sign counts
            sign = _mean_sign(change, change_noise**2 + bend**2 / 12)
            parts[FRICTION] = sign
            total += force.friction_level * sign
            # While the mass sticks, which shows as a velocity below the noise, all that is known
            # of the friction is that it is less than its level; the same where it turns.
            doubt += force.friction_level * np.sqrt(np.maximum(1 - sign**2, 0))
        if force.strength:
            parts[HYSTERESIS] = self._hysteresis(q)
            total += force.strength * parts[HYSTERESIS]
        for law, states in zip(force.laws, self._laws):
            added, unsure = self._follow(law, states, q, change / self._terms.step,
                                         self._terms.output_noise * noise,
                                         change_noise / self._terms.step)
            total += added
            doubt += unsure
        return total, doubt, parts

    def _follow(self, law, states, q, velocity, q_noise, velocity_noise):
        """Force of a further law, and how far one that is noisier by its deviation is off it."""
        forces, unsure = np.zeros((2, *q.shape))
        for row, (state, before) in enumerate(states):
            if not q.shape[1]:
                continue
            forces[row], after = law.along(q[row], velocity[row], self._terms.step, state, before)
            if q_noise[row].any():
                other, _ = law.along(q[row] + q_noise[row], velocity[row] + velocity_noise[row],
                                     self._terms.step, state, before)
                unsure[row] = np.abs(other - forces[row])
            states[row] = after, (q[row, -1], velocity[row, -1])
        return forces, unsure

    def _hysteresis(self, q):
        force = self._terms.force
        result = np.empty_like(q)
        for row in range(len(q)):
            z, before = self._z[row], self._before[row]
            for i, value in enumerate(q[row].tolist()):
                try:
                    z = follow_one_way(z, value - before, force.beta, force.gamma)
                except OverflowError:
                    z = np.inf
                if not abs(z) < _LARGEST_Z:
                    z = 0.0  # no mass goes that far: it begins anew
                before = value
                result[row, i] = z
            self._z[row], self._before[row] = z, before
        return result


def _mean_sign(values, variance):
    """Mean of the sign of something that is seen as `values` through noise."""
    from scipy.special import erf
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(variance > 0, erf(values / np.sqrt(2 * variance)), np.sign(values))


def _power_terms(polynomial, q):
    total = np.zeros_like(q)
    for coefficient in reversed(polynomial):
        total = (total + coefficient) * q
    return total * q


def _slope(polynomial, q):
    total = np.zeros_like(q)
    for power, coefficient in reversed(list(enumerate(polynomial, 2))):
        total = (total + power * coefficient) * q
    return total
