"""Stable, causal filter of the correction: taps and a bank of recursive sections in parallel."""

import dataclasses
import functools

import numpy as np

from .linear_filter import run_filter, run_sections

# Error of a filter in series, of its response, from which on it is not used.
_ROUNDING = 1e-6
# Poles closer to one than this do not run in series with others.
_SLOWEST_IN_CHAIN = 1e-6
# lfilter convolves a pure FIR by another, length-dependent route: a zero keeps it away.
_FIR = np.array([1.0, 0.0])


@dataclasses.dataclass(frozen=True, eq=False)
class ParallelFilter:
    r"""Discrete filter :math:`G(z) = \sum_k b_k z^{-k} + \sum_j r_j / (1 - p_j z^{-1})`.

    The taps do the fast part. Real poles close to one carry the long memory of fractional damping
    and of a high-pass at the price of a few multiplications, and complex pairs cancel the zeros of
    a sensor exactly.

    Attributes
    ----------
    taps : ndarray, shape (n_taps,)
    poles : ndarray of complex, shape (n_poles,)
        In the z plane, inside the unit circle, complex ones in adjacent conjugate pairs.
    residues : ndarray of complex, shape (n_poles,)
    lead : int
        Whole samples by which the input waits before all this.
    """

    taps: np.ndarray
    poles: np.ndarray
    residues: np.ndarray
    lead: int = 0

    def frequency_response(self, frequency_hz, sampling_rate_hz):
        """Complex response at `frequency_hz` [Hz], any shape."""
        z = np.exp(-2j * np.pi * np.asarray(frequency_hz, float) / sampling_rate_hz)
        recursive = (self.residues / (1 - self.poles * z[..., None])).sum(axis=-1)
        return (np.polyval(self.taps[::-1], z) + recursive) * z**self.lead

    @property
    def static_gain(self):
        """Response to a constant input."""
        return float(self.taps.sum() + (self.residues / (1 - self.poles)).sum().real)

    @property
    def noise_gain(self):
        """Standard deviation of the output per standard deviation of white noise at the input.

        The square root of the sum of the squared impulse response, in closed form: the slow poles
        would need millions of terms.
        """
        later = self.residues * self.poles**len(self.taps)
        tail = np.outer(later, later) / (1 - np.outer(self.poles, self.poles))
        return float(np.sqrt(np.sum(self.impulse_head**2) + max(tail.sum().real, 0.0)))

    @property
    def impulse_head(self):
        """Impulse response after the lead, as far as the taps reach.

        Taps and recursion may cancel each other there, so neither alone says how loud the noise is.
        """
        powers = self.poles[:, None] ** np.arange(len(self.taps))
        return self.taps + (self.residues[:, None] * powers).sum(axis=0).real

    @functools.cached_property
    def chains(self):
        """`chains_within` rounding that nobody can measure."""
        return self.chains_within(_ROUNDING)

    def chains_within(self, rounding):
        r"""The same filter as taps beside chains of second-order sections, which run much faster.

        With a constant :math:`d = \sum_j |r_j|` added, the recursive part has zeros that lie beside
        its poles and is a product; the taps take the constant back. The zeros are eigenvalues of
        the recursion's matrix with its output fed back,
        :math:`d + \sum_j r_j p_j/(z - p_j) = d \prod_j (z - z_j)/(z - p_j)`, reckoned as
        distances from one, which the slow ones hardly differ from. The slowest poles of all stay
        beside the product: their rounded coefficients would spoil the whole of it. Where residues
        cancel each other so much that rounding shows, the sections stay beside each other.

        Parameters
        ----------
        rounding : float
            Share of the response that it may be off by, from a thousandth of its largest on.

        Returns
        -------
        taps : ndarray, shape (n_taps,)
        chains : list of ndarray, shape (m, 6)
            Sections in series, as `run_sections` takes them.
        """
        taps, chains = self._in_series()
        share = np.r_[0, np.geomspace(1e-9, 0.5, 300)]
        z = np.exp(-2j * np.pi * share)
        found = np.polyval(taps[::-1], z) + sum(np.prod(
            [np.polyval(section[2::-1], z) / np.polyval(section[:2:-1], z) for section in chain],
            axis=0) for chain in chains)
        stated = self.frequency_response(share, 1.0) / z**self.lead
        size = np.abs(stated)
        if np.all(np.abs(found - stated) <= rounding * (size + 1e-3 * size.max())):
            return taps, chains
        return np.array(self.taps, float), self._side_by_side()

    def _side_by_side(self):
        """Chains of one section each, for a real pole or a conjugate pair."""
        chains = [_real_section(pole.real, residue.real)
                  for pole, residue in zip(self.poles, self.residues) if not pole.imag]
        chains += [np.array([[2 * residue.real, -2 * (residue * pole.conj()).real, 0.0,
                              1.0, -2 * pole.real, abs(pole)**2]])
                   for pole, residue in zip(self.poles, self.residues) if pole.imag > 0]
        return chains

    def _in_series(self):
        taps = np.array(self.taps, float)
        alone = (self.poles.imag == 0) & (self.poles.real > 1 - _SLOWEST_IN_CHAIN)
        chains = [_real_section(pole.real, residue.real)
                  for pole, residue in zip(self.poles[alone], self.residues[alone])]
        poles, residues = self.poles[~alone], self.residues[~alone]
        size = np.abs(residues).sum()
        if not size:
            return taps, chains
        taps[0] += residues.sum().real - size
        count, distance, weight = len(poles), 1 - poles, residues * poles / size
        matrix, feed, out = np.zeros((count, count)), np.zeros(count), np.zeros(count)
        for i, pole in enumerate(poles):
            if not pole.imag:
                matrix[i, i], feed[i], out[i] = distance[i].real, 1.0, weight[i].real
            elif pole.imag > 0:
                # rotation by the pair, whose second pole follows
                matrix[i:i + 2, i:i + 2] = [[distance[i].real, -pole.imag],
                                            [pole.imag, distance[i].real]]
                feed[i], out[i:i + 2] = 1.0, (2 * weight[i].real, 2 * weight[i].imag)
        zeros = np.linalg.eigvals(matrix + np.outer(feed, out))
        chain = np.array([[*over, *under]
                          for over, under in zip(_in_twos(zeros), _in_twos(distance))])
        chain[0, :3] *= size
        return taps, [chain, *chains]


def _real_section(pole, residue):
    """Chain of one real pole, whose coefficient is not rounded."""
    return np.array([[residue, 0.0, 0.0, 1.0, -pole, 0.0]])


def _in_twos(distance):
    """Polynomials of the second degree in the delay, of roots so far from one.

    The conjugate pairs first, then the slowest with the fastest: of two slow ones, rounding would
    spoil the value at the delay one.
    """
    pairs = distance[distance.imag > 0]
    real = np.sort(distance[distance.imag == 0].real)
    slow, fast = real[:(len(real) + 1) // 2], real[::-1][:len(real) // 2]
    result = [[1.0, 2 * one.real - 2, abs(1 - one)**2] for one in pairs[np.argsort(abs(pairs))]]
    result += [[1.0, one + other - 2, (1 - one) * (1 - other)] for one, other in zip(slow, fast)]
    if len(slow) > len(fast):
        result.append([1.0, slow[-1] - 1, 0.0])
    return result


class FilterState:
    """A `ParallelFilter` running over the samples of some axes, in blocks of any length.

    Every output is computed by the same operations in the same order however the record is split,
    so the numbers are the same to the last bit.

    Parameters
    ----------
    parallel_filter : ParallelFilter
    level : ndarray, shape (k,)
        The input of each axis before the first sample: a constant.
    rounding : float, optional
        As for `ParallelFilter.chains_within`.
    """

    def __init__(self, parallel_filter, level, rounding=None):
        self._waiting = np.repeat(level[:, None], parallel_filter.lead, axis=1)
        self._taps, chains = (parallel_filter.chains if rounding is None
                              else parallel_filter.chains_within(rounding))
        self._taps_state = np.outer(level, steady_state(self._taps, _FIR))
        self._chains = [(chain, _steady_chain(chain, level)) for chain in chains]

    def process(self, values):
        """Outputs for the next inputs; shape (k, n) in and out."""
        if self._waiting.shape[1]:
            queue = np.concatenate([self._waiting, values], axis=1)
            count = values.shape[1]
            values, self._waiting = queue[:, :count], queue[:, count:]
        output, self._taps_state = run_filter(self._taps, _FIR, values, self._taps_state)
        for chain, state in self._chains:
            output += run_sections(chain, values, state)
        return output


class MotionPower:
    """Power of signals about their means, both over the last samples, in blocks of any length.

    Parameters
    ----------
    level : ndarray, shape (k,)
        Of each signal before the first sample.
    samples : int
        Time constant of both means.
    """

    def __init__(self, level, samples):
        share = 1 / (samples + 1)
        self._mean = np.array([share, 0.0]), np.array([1.0, share - 1.0])
        self._level_state = np.outer(level, steady_state(*self._mean))
        self._power_state = np.zeros((len(level), 1))

    def process(self, values):
        """Shape (k, n) in and out."""
        level, self._level_state = run_filter(*self._mean, values, self._level_state)
        apart = values - level
        apart *= apart
        power, self._power_state = run_filter(*self._mean, apart, self._power_state)
        return power


def _steady_chain(chain, level):
    """State of `run_sections` after inputs of these levels for ever."""
    state = np.empty((len(level), len(chain), 2))
    for i, section in enumerate(chain):
        b, a = section[:3], section[3:]
        state[:, i] = np.outer(level, steady_state(b, a))
        level = level * (b.sum() / a.sum())
    return state


def steady_state(b, a):
    """State of `run_filter` after a unit input for ever."""
    order = max(len(a), len(b)) - 1
    b, a = (np.pad(c, (0, order + 1 - len(c))) for c in (b, a))
    gain = b.sum() / a.sum()
    # z_i = b_{i+1} - a_{i+1} gain + z_{i+1}: transposed direct form II at rest in its steady state
    return np.cumsum((b[1:] - a[1:] * gain)[::-1])[::-1]
