"""Stable, causal filter of the correction: taps and a bank of recursive sections in parallel."""

import dataclasses

import numpy as np

from ..linear_filter import run_filter

# Samples over which `unknown_history` is looked up once.
_HISTORY_STEP = 8


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

    def unknown_history(self, count):
        """Weight of what came before the filter's start, `count` samples ago (array).

        Bound of the output's part that a unit history would still make after that many samples;
        the taps have then been filled.
        """
        decay = np.abs(self.poles) ** (np.asarray(count) - self.lead)[..., None]
        return (np.abs(self.residues) / np.abs(1 - self.poles) * decay).sum(axis=-1)

    def unknown_history_after(self, first, start, count):
        """`unknown_history` at `count` samples from `start` on, held over a few at a time.

        Where it is looked up depends on `first`, at most `start`, only: not on how the samples are
        split into blocks.
        """
        place = np.arange(start - first, start - first + count) // _HISTORY_STEP
        looked_up = self.unknown_history(first + _HISTORY_STEP * np.arange(place[0], place[-1] + 1))
        return looked_up[place - place[0]]

    def sections(self):
        """Numerators and denominators of the recursive sections, two poles in each."""
        pairs = []
        for i in range(0, len(self.poles), 2):
            poles, residues = self.poles[i:i + 2], self.residues[i:i + 2]
            if len(poles) == 2:
                numerator = [residues.sum(), -(residues * poles[::-1]).sum()]
                denominator = [1.0, -poles.sum(), poles.prod()]
            else:
                numerator, denominator = [residues[0]], [1.0, -poles[0]]
            pairs.append((np.real(numerator), np.real(denominator)))
        return pairs


class FilterState:
    """A `ParallelFilter` running over the samples of some axes, in blocks of any length.

    Every output is computed by the same operations in the same order however the record is split,
    so the numbers are the same to the last bit.

    Parameters
    ----------
    parallel_filter : ParallelFilter
    level : ndarray, shape (k,)
        The input of each axis before the first sample: a constant.
    """

    def __init__(self, parallel_filter, level):
        # lfilter convolves a pure FIR by another, length-dependent route: a zero keeps it away
        links = [(np.asarray(parallel_filter.taps, float), np.array([1.0, 0.0]))]
        links += parallel_filter.sections()
        self._links = [(b, a, np.outer(level, steady_state(b, a))) for b, a in links]
        self._waiting = np.repeat(level[:, None], parallel_filter.lead, axis=1)

    def process(self, values):
        """Outputs for the next inputs; shape (k, n) in and out."""
        if self._waiting.shape[1]:
            queue = np.concatenate([self._waiting, values], axis=1)
            count = values.shape[1]
            values, self._waiting = queue[:, :count], queue[:, count:]
        total = None
        for i, (b, a, state) in enumerate(self._links):
            output, state = run_filter(b, a, values, state)
            self._links[i] = (b, a, state)
            total = output if total is None else total + output
        return total


def steady_state(b, a):
    """State of `run_filter` after a unit input for ever."""
    order = max(len(a), len(b)) - 1
    b, a = (np.pad(c, (0, order + 1 - len(c))) for c in (b, a))
    gain = b.sum() / a.sum()
    # z_i = b_{i+1} - a_{i+1} gain + z_{i+1}: transposed direct form II at rest in its steady state
    return np.cumsum((b[1:] - a[1:] * gain)[::-1])[::-1]
