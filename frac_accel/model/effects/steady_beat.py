"""A lag that is a sawtooth of one frequency all along a record."""

from typing import NamedTuple

import numpy as np

# Deviations, and turns over the record, within which the frequency is looked for; steps for a turn.
_WITHIN, _AT_LEAST, _STEPS = 4.0, 2.0, 8
# Share of a beat that must add up at one frequency before its sawtooth is fitted.
_ADDS_UP = 0.5
# Turns that the jump takes in the fit's derivatives: wide at first, since a jump farther off has
# none, and less and less; the fits at the last width, of which the best counts.
_WIDTHS, _LAST = (0.3, 0.2, 0.13, 0.09, 0.05), 6
# Times that the chances of jumps that lie elsewhere are looked at, each time within as many
# deviations, and at so many places; the least turns, of one sample among all, to begin with.
_LOOKS, _AROUND, _PLACES, _LEAST = 4, 5.0, 41, 30.0
# Turns from a jump within which samples tell where it is in a stretch.
_NEAR = 0.1
# Stretches of equal power that count as independent. The phase wanders where its power is that many
# times what chance makes, and the mean square of its steps less than this many times its power (2
# of chance).
_STRETCHES, _SCATTERS, _WANDERS = 32, 2.0, 1.6
# Times the rate at which the output is known before it is read between samples.
_FINE = 4

STEADY = "it has one frequency all along the record"


class SteadyBeat(NamedTuple):
    """A sawtooth of one frequency, in sampling intervals.

    Attributes
    ----------
    frequency, frequency_std : float
        With its standard uncertainty.
    height, height_std : float
        Below zero where it falls.
    added : ndarray, shape (n,)
        What it adds to the output.
    wander : float
        RMS [turns] by which its phase wanders beyond chance; 0 where that does not show.
    """

    frequency: float
    frequency_std: float
    height: float
    height_std: float
    added: np.ndarray
    wander: float

    @property
    def words(self):
        """How its phase runs."""
        return STEADY + (
            f", beside a phase that wanders by {self.wander:.2g} of a turn" if self.wander else "")

    @classmethod
    def of(cls, measured, output, used, start, height):
        """The sawtooth that leaves least, from a `Start` and a height near it.

        Least squares beside a gain, an offset, a delay and a skew, so that the jumps alone tell the
        phase. The cost is no smooth function of where they are: mean and deviation of all that are
        likely count (I. A. Ibragimov, R. Z. Has'minskii, *Statistical Estimation* (1981), ch. 5).
        The height's uncertainty is by the scores of stretches (P. J. Huber, 5th Berkeley Symposium
        1 (1967) 221-233).

        Parameters
        ----------
        measured, output : ndarray, shape (n,)
        used : ndarray of bool, shape (n,)
        start : Start
        height : float
            Below zero where the sawtooth falls.

        Returns
        -------
        SteadyBeat or None
            None where no sample that counts is near a jump.
        """
        read, steepness = _between(output)
        count = np.arange(len(output))
        time = count / len(output) - 0.5  # of the record: all turns are of the same order
        # delay, height, turns in the middle, turns over the record
        place = np.array([0.0, height, start.turn + start.frequency * len(output) / 2,
                          start.frequency * len(output)])
        best = None
        for width in (*_WIDTHS, *[_WIDTHS[-1]] * _LAST):
            turn = (place[2] + place[3] * time + 0.5) % 1 - 0.5
            there = count + place[0] + place[1] * turn
            values, slope = read(there), steepness(there) * used
            error = (measured - values) * used
            moves = place[1] * slope * np.where(abs(turn) < 0.5 - width / 2, 1.0, 1 - 1 / width)
            columns = np.stack([used, values * used, slope * time, slope, slope * turn, moves,
                                moves * time], axis=1)
            inverse = np.linalg.pinv(columns.T @ columns, hermitian=True)
            found = inverse @ (columns.T @ error)
            error -= columns[:, :3] @ found[:3]
            left = error @ error
            if width == _WIDTHS[-1] and (best is None or left < best[0]):
                best = left, place.copy(), columns, inverse, error, turn, measured - values - error
            place += found[3:]
        _, place, columns, inverse, error, turn, taken = best
        scores, stretch = _by_stretches(columns, error)
        stds = np.sqrt(np.diag(inverse @ (scores.T @ scores) @ inverse))
        near = used & (abs(turn) > 0.5 - _NEAR)
        if not near.any():
            return None
        other = (measured - taken - read(
            count + place[0] + place[1] * (turn - np.sign(turn))))[near]
        power = np.sum((columns[:, 3] * error)**2) / max(np.sum(columns[:, 3]**2), 1e-300)
        jumps = _Jumps((turn - 0.5 * np.sign(turn))[near], time[near],
                       np.sign(turn[near]) * (other**2 - error[near]**2) / max(power, 1e-300),
                       stretch[near])
        moved, stds[5:] = jumps.likely(jumps.line(), np.maximum(stds[5:], _LEAST / len(output)))
        place[2:] += moved
        turn = (place[2] + place[3] * time + 0.5) % 1 - 0.5
        stds[5:], wander = jumps.beside_wander(moved, stds[5:])
        return cls(float(place[3]) / len(output), float(stds[6]) / len(output), float(place[1]),
                   float(stds[4]), (read(count + place[1] * turn) - output) * used, wander)


class Start(NamedTuple):
    """Where a sawtooth's fit begins.

    Attributes
    ----------
    frequency : float
        In turns by sample, near which most adds up over a whole record.
    turn : float
        Of the sawtooth at the first sample; -0.5 and 0.5 are its jump.
    adds_up : float
        Share of the first harmonic that adds up there.
    """

    frequency: float
    turn: float
    adds_up: float

    @classmethod
    def of(cls, shared, frequency, std, rising, tracked):
        """From a share in the slope, shape (n,), near a coarse frequency, and the size of its first
        harmonic where its phase is followed."""
        count = np.arange(len(shared))
        span = max(_WITHIN * std, _AT_LEAST / len(shared))
        size = max(int(1 / (8 * span)), 1)
        blocks = -(-len(shared) // size)
        points = _STEPS * blocks
        edges = np.arange(0, len(shared), size)
        spectra = [np.fft.fft(np.add.reduceat(
            shared * np.exp(-2j * np.pi * k * frequency * count), edges), points) for k in (1, 2)]
        steps = np.arange(-int(span * points * size), int(span * points * size) + 1)
        power = sum(abs(spectrum[k * steps % points])**2
                    for k, spectrum in zip((1, 2), spectra))
        frequency += steps[np.argmax(power)] / (points * size)
        first = np.sum(shared * np.exp(-2j * np.pi * frequency * count))
        # a rising sawtooth whose first harmonic is a cosine is zero a quarter before its crest
        return cls(float(frequency),
                   float(np.angle(first) / (2 * np.pi) + (0.25 if rising else -0.25)),
                   float(abs(first) / max(tracked, 1e-300)))

    @property
    def is_steady(self):
        """Whether enough adds up for a fit."""
        return self.adds_up > _ADDS_UP


def _between(output):
    """Functions of places among the samples: the output, and its slope."""
    from scipy.interpolate import CubicSpline

    from ...signals.convolution import refined
    # a filter by windows would ripple, by as much as a gain of 0.9993
    fine = refined(output, _FINE)
    spline = CubicSpline(np.arange(len(fine)) / _FINE, fine)
    slope = spline.derivative()

    def limited(places):
        return np.clip(places, 0, len(output) - 1)
    return lambda places: spline(limited(places)), lambda places: slope(limited(places))


class _Jumps(NamedTuple):
    """Samples near the jumps of a sawtooth.

    Attributes
    ----------
    turn, time : ndarray, shape (n,)
        Turns after the jump, and instants.
    cost : ndarray, shape (n,)
        What a sample costs more after a jump than before it, in variances.
    stretch : ndarray of int, shape (n,)
    """

    turn: np.ndarray
    time: np.ndarray
    cost: np.ndarray
    stretch: np.ndarray

    def likely(self, mean, std):
        """Mean and deviation, both of shape (2,), of the turns in the middle and over the record by
        which the jumps are earlier; near a first mean, within some deviations."""
        steps = np.linspace(-_AROUND, _AROUND, _PLACES)
        for _ in range(_LOOKS):
            middle, over = mean[:, None] + std[:, None] * steps
            near = abs(self.turn + mean[0] + mean[1] * self.time) < _AROUND * (std[0] + std[1] / 2)
            turn, time, cost = self.turn[near], self.time[near, None], self.cost[near]
            chances = _chances(np.stack([((turn + m)[:, None] + time * over > 0).T @ cost
                                         for m in middle]))
            (mean_m, std_m), (mean_o, std_o) = (
                _moments(chances.sum(axis=1), middle), _moments(chances.sum(axis=0), over))
            # likely places are narrow, and may lie between two that were looked at
            mean, std = np.array([mean_m, mean_o]), np.maximum([std_m, std_o],
                                                               (steps[1] - steps[0]) * std)
        return mean, std

    def by_stretch(self):
        """Turns by which the jumps of each stretch are earlier, their deviations, and the times."""
        places = np.linspace(-_NEAR, _NEAR, 2 * _PLACES)
        found = []
        for rows in (self.stretch == k for k in range(_STRETCHES)):
            if rows.any():
                chances = _chances((self.turn[rows, None] + places > 0).T @ self.cost[rows])
                found.append((*_moments(chances, places), self.time[rows].mean()))
        return np.array(found).T

    def line(self):
        """Turns in the middle and over the record of a line through all stretches."""
        phases, stds, times = self.by_stretch()
        return np.polyfit(times, phases, 1, w=1 / stds)[::-1]

    def beside_wander(self, moved, stds):
        """Deviations, shape (2,), with what the stretches scatter more around a line than chance
        lets them; and the RMS of that [turns] where it goes on from one to the next."""
        phases, of_chance, times = self.by_stretch()
        off = phases - moved[0] - moved[1] * times
        stds = stds * max(np.sqrt(np.mean((off / of_chance)**2)), 1.0)
        steps, power = np.diff(off), np.mean(off**2)
        if power < _SCATTERS * np.mean(of_chance**2) or np.mean(steps**2) > _WANDERS * power:
            return stds, 0.0
        # as the mean of its steps, each from one stretch to the next
        return np.hypot(stds, [np.sqrt(power), np.std(steps) * np.sqrt(len(off))]), np.sqrt(power)


def _chances(costs):
    chances = np.exp((costs.min() - costs) / 2)
    return chances / chances.sum()


def _moments(chances, places):
    """Mean and deviation of places with some chances, with what lies between two of them."""
    mean = chances @ places
    return mean, np.sqrt(chances @ (places - mean)**2 + (places[1] - places[0])**2 / 12)


def _by_stretches(columns, error):
    """Sums of a fit's scores by stretches in which the phase has equal weight, and these."""
    power = columns[:, 5]**2
    total = np.cumsum(power)
    stretch = np.minimum((total / max(total[-1], 1e-300) * _STRETCHES).astype(int), _STRETCHES - 1)
    scores = np.stack([np.bincount(stretch, column * error, _STRETCHES) for column in columns.T],
                      axis=1)
    return scores, stretch
