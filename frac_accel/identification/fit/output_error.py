"""Output-error fit of a continuous-time model structure to a measured pair, in the time domain."""

import dataclasses
import functools
from typing import NamedTuple

import numpy as np
from scipy.fft import rfft

from ...errors import IdentificationError
from ...model.effects import longest_identified
from ...signals.convolution import Convolution, exponentials
from ...signals.kept import kept
from ...signals.normal_equations import solve
from ..response.excitation import strongest_stretch
from ..response.frequency_response import averaged_response, bulk_delay, phase_delay
from .uncertainty import sandwich, spectrum_room, white_noise

# Samples at both ends that the band-limited simulation cannot know, besides the unknown start.
_EDGE = 32
_WAY = 64
_ITERATIONS = 150
# A step this small against the standard uncertainties changes nothing that the data can tell.
_SMALL_STEP = 1e-2
_IMPROVEMENTS = 5
# Steps after which a search that goes on is in a curved valley, and how far it looks ahead there.
_STRAIGHT, _AHEAD = 8, 0.1
# Damping of the search: enough to keep a singular system solvable, and what is as good as none.
_LOWEST_DAMPING, _UNDAMPED, _HIGHEST_DAMPING = 1e-9, 1e-3, 1e6
# Error of a start on the averaged response, over the best one's, with which it leads nowhere.
_HOPELESS = 1.5
# Share of its first amplitude at which a free motion counts for as much as all else that is known
# of it: that it was not much larger than the output.
_FAINT = 1e-3
_OVER = -20.0
# Logarithm of the share of it that is nothing beside any of its first amplitude.
_NOTHING = -60.0
# Energy, in variances of the noise, of a free motion that noise alone may show: the largest of a
# spectrum of 1e5 lines has 23.
_FEIGNED = 50.0
# Power of the free motions, of the output, from which on they are no small part of it.
_RINGING = 0.05
# Share of the output's power below which a model explains little of it.
_POOR = 0.7
# Samples by which no sensor is earlier than what moves it.
_EARLY = 2
# Starting points half a period away that are tried then.
_HALF_AWAY = 4
# Distance of the logarithms of frequencies that count as one.
_BESIDE = 1e-9
_START_LENGTH = 16384
# Stretch of a record several times as long on which the search goes on before it sees all of it.
_MIDDLE_LENGTH, _MUCH_LONGER = 1 << 17, 2
# Lines of the responses that are evaluated at a time.
_LINES = 1 << 15
_TRIAL_ITERATIONS = 5
# Share of the output's power, times the number of independent frequencies, that the best of all
# resonances and delays still explains of an unrelated signal.
_UNRELATED = 10
# Share from which such a record may as well belong together.
_SOME = 0.1
# The search for a delay goes no further than this share of the record.
LONGEST_DELAY = 0.25
_ROUNDING = 1e-9


@dataclasses.dataclass(frozen=True)
class Fit:
    """Result of `fit_output_error`.

    Attributes
    ----------
    names : tuple of str
        ``sensitivity``, the structure's parameters, ``delay_s``, ``offset``.
    values : ndarray, shape (p,)
    covariance : ndarray, shape (p, p)
        Allows for a residual that is not white, and for the way that the data would go beyond a
        bound of the search.
    residual : ndarray, shape (n,)
        Measured less simulated [output units]; NaN where not judged.
    unknowns : ndarray
        Where the search ended, in its own coordinates.
    at_bounds : tuple of str
        The structure's parameters with which it ended at a bound of the search.
    gradient : ndarray, shape (p - 1, n), or None
        Derivatives of the output by all parameters but the offset; 0 where not judged. Of single
        precision: they are kept, and only tell what no residual can show.
    free_share : float
        Power of the free swing that began before the record, of the output's.
    fastest_decay : float
        Rate of the free swing's decay [1/s], two standard uncertainties added; NaN without one.
    second_order : ndarray, shape (p,), or 0
        What the parameters' variances have beyond the covariance, which is linear: so the response,
        which may be known far better than each of them, can be propagated from it.
    """

    names: tuple
    values: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray
    unknowns: np.ndarray
    at_bounds: tuple
    gradient: np.ndarray | None
    free_share: float
    fastest_decay: float
    second_order: np.ndarray | float = dataclasses.field(default=0.0, kw_only=True)

    @property
    def std(self):
        """Standard uncertainties, shape (p,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0) + self.second_order)

    @property
    def rmse(self):
        """RMS of the residual [output units]."""
        return float(np.sqrt(np.nanmean(self.residual**2)))

    @functools.cached_property
    def noise_std(self):
        """White part of the residual (`white_noise`)."""
        return white_noise(self.residual)

    def __getitem__(self, name):
        return float(self.values[self.names.index(name)])


def fit_output_error(structure, reference, sensor, sampling_rate_hz, valid=None, lag_s=0.0,
                     start=None, uncertainty=True, hint=None, held=None):
    r"""Parameters of a structure, with sensitivity, delay and offset.

    Minimises the sum of the squared differences between the measured output and that simulated
    from the reference,

    .. math:: y(t) = S \, (g_\theta * a)(t - \tau) + b + \sum_i c_i e_i(t)

    (output error, L. Ljung, *System Identification*, 2nd ed., section 4.2), where the :math:`e_i`
    are the structure's free motions, which stand for what it did before the record. Sensitivity,
    offset and free motions enter linearly and are found anew in each Gauss-Newton step (variable
    projection, G. Golub, V. Pereyra, *Inverse Problems* 19 (2003) R1). The start is the best of a
    grid on the averaged frequency response.

    Parameters
    ----------
    structure : Structure
        See `structures`.
    reference, sensor : ndarray, shape (n,)
    sampling_rate_hz : float
    valid : ndarray of bool, shape (n,), optional
        Samples that count.
    lag_s : float
        Time by which the sensor's instants are later than the reference's.
    start : ndarray, optional
        `Fit.unknowns` of a fit of the same structure to start from, instead of the grid.
    uncertainty : bool
        Whether the covariance is wanted; NaN otherwise.
    hint : ndarray, optional
        Unknowns to start from besides the grid's best.
    held : dict of int to float, optional
        Values of unknowns that are known, by place; they get no variance. With `start` only.

    Returns
    -------
    Fit

    Raises
    ------
    IdentificationError
        If the best model explains no more than chance would.
    """
    very_long = start is None and len(sensor) > _MUCH_LONGER * _MIDDLE_LENGTH
    if start is None:
        # where the motion is strongest is enough to find out roughly where the parameters are
        part = strongest_stretch(reference, _START_LENGTH, valid)
        rough = _Problem(structure, reference[part], sensor[part], sampling_rate_hz,
                         None if valid is None else valid[part], lag_s)
        state = rough.solve(rough.starts() if hint is None else [hint, *rough.starts()])
        if structure.names and (state.free_share > _RINGING or rough.explained(state) < _POOR
                                or state.theta[-1] < -_EARLY):
            # what still rings from before the record may have led astray
            other = rough.solve(rough.ringing_starts())
            state = min(state, other, key=lambda state: state.cost)
        rough.require_relation(state)
        if rough.n == len(sensor):
            rough, state = rough.within_delay(state)
            return rough.result(state, uncertainty)
        start = state.theta
        if very_long:
            # a search is dear on all samples, where it then has little left to do
            part = strongest_stretch(reference, _MIDDLE_LENGTH, valid)
            start = _Problem(structure, reference[part], sensor[part], sampling_rate_hz,
                             None if valid is None else valid[part], lag_s).solve([start]).theta
    problem = _Problem(structure, reference, sensor, sampling_rate_hz, valid, lag_s, held)
    state = problem.solve([start])
    if very_long and structure.names and problem.explained(state) < _POOR:
        # a long sweep is loudest in a band that may have led astray
        state = min(state, problem.solve(problem.starts()), key=lambda state: state.cost)
    problem.require_relation(state)
    problem, state = problem.within_delay(state)
    return problem.result(state, uncertainty)


def longest_delay(samples, sampling_rate_hz):
    """Delay that is searched for in a record, in samples: a model must be able to hold it."""
    longest_s = longest_identified("delay_s") * (1 - _ROUNDING)
    return min(LONGEST_DELAY * samples, longest_s * sampling_rate_hz)


class _Problem:
    """Unknowns of the search: the structure's own and the delay in samples."""

    def __init__(self, structure, reference, sensor, rate, valid, lag_s, held=None, room=0):
        self.structure, self.rate, self.lag_s, self.held = structure, rate, lag_s, held
        self.n = len(sensor)
        # the usual level is taken as steady before the record (its response is a constant), with
        # a smooth way from there to the first value
        self.level = np.median(reference)
        way = 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, _WAY, endpoint=False))
        moving = np.r_[way * (reference[0] - self.level), reference - self.level]
        self.convolution = Convolution(moving, rate, max(2 * _EDGE, room) / rate)
        s = self.convolution.s
        # by blocks, of which temporary values are small
        self.blocks = [slice(at, at + _LINES) for at in range(0, len(s), _LINES)]
        self.prepared = [structure.prepare(s[lines]) for lines in self.blocks]
        self.rows_of = {}
        self.width = spectrum_room(self.n)
        edge = min(_EDGE, self.n // 8)
        used = np.ones(self.n, bool) if valid is None else valid.copy()
        used[:edge] = used[-edge:] = False
        if not used.any():
            raise IdentificationError("no sample is left in both topics, away from the ends")
        self.used = used
        self.judged = slice(edge, self.n - edge) if used.sum() == self.n - 2 * edge else used
        self.sensor = sensor[self.judged]
        self.instants = (np.arange(self.n) / rate)[self.judged]
        self.size = float(np.std(self.sensor))
        if self.size**2 == 0:
            raise IdentificationError("the sensor's output is constant where it counts")
        self.reference, self.whole = reference, sensor
        low, high = structure.bounds(rate, self.n)
        reach = longest_delay(self.n, rate)
        self.low, self.high = np.r_[low, -reach], np.r_[high, reach]
        for place, value in (held or {}).items():
            self.low[place] = self.high[place] = value

    def solve(self, starts):
        """State with the least cost that a search from one of the starts ends in."""
        trials = [self.search(theta, _TRIAL_ITERATIONS if len(starts) > 1 else _ITERATIONS)
                  for theta in starts]
        trials.sort(key=lambda state: state.cost)
        best, *others = (state if state.converged else self.search(state.theta, _ITERATIONS)
                         for state in trials[:self.structure.searches])
        for state in others:
            if state.cost < best.cost * (1 - 1e-9):
                best = state
        return best

    def within_delay(self, state):
        """The problem and its state, or, where the delay is longer than the ends that do not count
        anyway, without the samples whose motion lies beyond the reference's ends."""
        late = state.theta[-1]
        beyond = int(np.ceil(abs(late))) + _EDGE
        if beyond <= 2 * _EDGE or beyond > self.n // 4:
            return self, state
        valid = self.used.copy()
        valid[slice(beyond) if late > 0 else slice(self.n - beyond, None)] = False
        again = _Problem(self.structure, self.reference, self.whole, self.rate, valid, self.lag_s,
                         self.held, 2 * beyond)
        return again, again.solve([state.theta])

    def ringing_starts(self):
        """Starting points where the loudest of the output is the sensor's own free motion."""
        frequency = np.fft.rfftfreq(self.n, 1 / self.rate)
        taper = np.hanning(self.n)
        loudness = np.abs(rfft(taper * (self.whole - self.whole.mean())))
        loudest = frequency[1 + np.argmax(loudness[1:])]
        grid = self.structure.grid(frequency[1], frequency[-1], loudest)
        distance = np.abs(grid[:, 0] - np.log(loudest))
        near = grid[distance < distance.min() + _BESIDE]
        # half a period away, with the other polarity, looks much the same
        half = 0.5 * self.rate / loudest
        delay = phase_delay(self.reference, self.whole) + self.lag_s * self.rate
        plain, *others = ([np.r_[own, delay + away] for own in near] for away in (0.0, half, -half))
        others = sorted(sum(others, []), key=lambda theta: self.state(theta).cost)
        return [*plain, *others[:_HALF_AWAY]]

    def starts(self):
        """Most promising starting points: the grid's best, improved on the averaged response."""
        bulk = bulk_delay(self.reference, self.whole)
        frequency, response, weight = averaged_response(self.reference, self.whole, self.rate, bulk)
        # of the power of a signal next to zero, or without bound, nothing is left either
        energy = weight * np.abs(response)**2
        if not 0 < np.sum(energy * frequency) < np.inf:
            raise IdentificationError("no frequency is left at which the record says how the "
                                      "sensor responds")
        s = 2j * np.pi * frequency
        prepared = self.structure.prepare(s)
        peak = frequency[np.argmax(np.abs(response))]
        grid = self.structure.grid(frequency[0], frequency[-1], peak)
        models = self.structure.response(prepared, grid.T[:, :, None])
        # the correlation may have peaked half a period of the resonance away from the delay
        reach = 0.75 * self.rate * np.sum(energy) / np.sum(energy * frequency) + 2
        step = max(0.25, self.rate / (8 * frequency[-1]), reach / 100)
        delays = np.arange(-reach, reach + step, step)
        turned = (weight * response)[:, None] * np.exp(np.outer(s, delays) / self.rate)
        shared = np.real(np.conj(models) @ turned)
        explained = shared**2 / (np.abs(models)**2 @ weight)[:, None]
        held = np.array([name in self.structure.held for name in self.structure.names], bool)
        best_delay = np.argmax(explained, axis=1)
        explained = np.max(explained, axis=1)
        chosen, seen = [], {}
        # neighbours in frequency end in the same place; other dampings may not
        kinds = np.c_[np.round(grid[:, :1], 1), np.round(grid[:, 1:], 3)].tolist()
        groups = grid[:, held].tolist()
        most = self.structure.starting_points * len(set(map(tuple, groups)))
        for point in np.argsort(explained)[::-1]:
            kind = tuple(kinds[point])
            group = seen.setdefault(tuple(groups[point]), set())
            if kind not in group and len(group) < self.structure.starting_points:
                group.add(kind)
                chosen.append([*grid[point], delays[best_delay[point]]])
                if len(chosen) == most:
                    break
        # half a period of the resonance, with the other polarity, looks much the same
        half = np.r_[np.zeros(len(held)), self.rate / (2 * peak)]
        chosen = np.array(chosen)
        chosen = np.concatenate([chosen, [chosen[0] - half, chosen[0] + half]])
        model = _AveragedResponse(self.structure, s, prepared, response, np.sqrt(weight), self)
        costs, improved = model.improve(chosen)
        lag = bulk + self.lag_s * self.rate
        starts = []
        for place in np.argsort(costs):
            if costs[place] > _HOPELESS * np.min(costs) and not held.any():
                break
            start = np.r_[improved[place][:-1], improved[place][-1] + lag]
            if not any(np.max(np.abs(start - other)) < 0.05 for other in starts):
                starts.append(start)
        return starts[:self.structure.trials]

    def rows(self, theta):
        """`_Rows` at a place in the search, of which the last is kept; of short records, three."""
        return kept(self.rows_of, theta.tobytes(), self._rows, theta,
                    most=1 if self.n > _MIDDLE_LENGTH else 3)

    def _rows(self, theta):
        own, delay = theta[:-1], theta[-1] / self.rate - self.lag_s
        # one that is over long before the first used sample is none
        decays = [-rate for rate in self.structure.decay_rates(own, self.instants[-1])
                  if -rate * self.instants[0] > _OVER]
        pole, pole_slopes = self.structure.mode(own)
        rings = pole is not None and pole.real * self.instants[0] > _OVER
        swing = self.swing(pole) if rings else None
        count = 2 + 2 * rings + len(decays)
        transfer, *slopes = self.transfers(own, delay)
        # with room for what `result` may add; what is never written to takes no memory
        room = np.zeros((count + len(slopes) + 3, self.width))
        rows = room[:-2, :len(self.sensor)]
        # first, so that no other row is there yet while all transfer functions are
        for place in range(count, len(rows) - 1):
            self.respond(slopes.pop(0), rows[place])
        # the derivative of a delay by one sample
        self.respond(transfer * self.convolution.s * (-1 / self.rate), rows[-1])
        self.respond(transfer, rows[0])
        del transfer
        rows[1] = 1.0
        if rings:
            rows[2, :len(swing)], rows[3, :len(swing)] = swing.real, swing.imag
        for row, rate in zip(rows[2 + 2 * rings:count], decays):
            last = np.searchsorted(self.instants, _NOTHING / rate)
            np.exp(rate * self.instants[:last], out=row[:last])
        known = rows[:count]
        # what was over before the first used sample fades out of the fit instead of dropping out
        faint = np.diag(np.r_[0.0, 0.0, np.full(count - 2, _FAINT**2)])
        gram = known @ known.T
        linear = solve(gram + faint, known @ self.sensor)
        residual = self.sensor - linear @ known
        noise = residual @ residual / len(residual)
        swung = linear[2:4] if rings else np.zeros(0)
        energy = swung @ gram[2:2 + len(swung), 2:2 + len(swung)] @ swung
        mean = swung @ gram[1, 2:2 + len(swung)] / len(residual)
        real = energy > _FEIGNED * noise
        if real:
            # with the pole, what it left behind changes as well; what noise feigns of it does not
            change = (linear[2] - 1j * linear[3]) / linear[0] * self.instants[:len(swing)] * swing
            for row, slope in zip(rows[count:-1], pole_slopes):
                row[:len(swing)] += (slope * change).real
        return _Rows(room, rows, linear, faint, residual, swing, bool(real),
                     float((energy / len(residual) - mean**2) / self.size**2))

    def respond(self, transfer, row):
        """Write a response at the judged samples; its transfer function is overwritten."""
        row[:] = self.convolution.response(transfer, consumed=True)[_WAY:][self.judged]

    def swing(self, pole):
        """Free motion with a pole at the judged samples, as long as there is anything of it."""
        last = np.searchsorted(self.instants, _NOTHING / pole.real) if pole.real < 0 else self.n
        # as many from the record's start
        count = round(self.instants[:last][-1] * self.rate) + 1
        judged = self.judged if isinstance(self.judged, slice) else self.judged[:count]
        return exponentials(0.0, pole / self.rate, count)[judged]

    def transfers(self, own, delay):
        """Responses that give the simulated output, and its derivatives by `own`, as a list."""
        s = self.convolution.s
        turn = exponentials(-s[0] * delay, -(s[1] - s[0]) * delay, len(s))
        found = [np.empty(len(s), complex) for _ in range(len(own) + 1)]
        for lines, prepared in zip(self.blocks, self.prepared):
            response, slopes = self.structure.gradient(prepared, own)
            for values, part in zip(found, (response, *slopes)):
                np.multiply(part, turn[lines], out=values[lines])
        return found

    def search(self, theta, iterations):
        """Levenberg-Marquardt from `theta`; the last state."""
        state = self.state(np.clip(theta, self.low, self.high))
        damping = _LOWEST_DAMPING
        for iteration in range(iterations):
            inner, slope = state.reduced()
            diagonal = np.diag(np.diag(inner))
            enough = _SMALL_STEP**2 * state.cost / len(self.sensor)
            moved = False
            while damping < _HIGHEST_DAMPING:
                step = self.step(state.theta, inner + damping * diagonal, slope)
                if damping < _UNDAMPED and slope @ step < enough:
                    return dataclasses.replace(state, converged=True)
                if iteration >= _STRAIGHT:
                    step += self.bend(state, step, inner + damping * diagonal)
                new = self.state(np.clip(state.theta + step, self.low, self.high))
                if new.cost < state.cost:
                    moved = True
                    break
                if abs(slope @ step) < 1e-12 * state.cost:
                    break
                damping = max(8 * damping, 1e-4)
            if not moved:
                return dataclasses.replace(state, converged=True)
            state, damping = new, max(damping / 10, _LOWEST_DAMPING)
        return state

    def step(self, theta, matrix, slope):
        """Step within the bounds: what stands at one and is pushed outwards stays."""
        free = np.ones(len(theta), bool)
        while True:
            step = np.zeros(len(theta))
            step[free] = solve(matrix[np.ix_(free, free)], slope[free])
            step /= max(1, np.max(np.abs(step)))
            outwards = np.where(step < 0, theta <= self.low, (theta >= self.high) & (step > 0))
            stuck = free & outwards
            if not stuck.any():
                return step
            free &= ~stuck

    def bend(self, state, step, matrix):
        """What the residual's curvature along a step adds to it; zero where it is no small part.

        Geodesic acceleration for narrow curved valleys (M. Transtrum, J. Sethna,
        arXiv:1201.5885).
        """
        here = self.rows(state.theta)
        ahead = self.rows(np.clip(state.theta + _AHEAD * step, self.low, self.high))
        count = len(state.linear)
        slopes = state.linear[0] * here.rows[count:]
        known = here.rows[:count]
        gram = state.gram[:count, :count]
        straight = step @ slopes
        straight -= solve(gram, known @ straight) @ known
        curved = 2 / _AHEAD * ((ahead.residual - here.residual) / _AHEAD + straight)
        curved -= solve(gram, known @ curved) @ known
        scale = np.sqrt(np.diag(matrix))
        bend = np.where(step == 0, 0.0, 0.5 * solve(matrix, slopes @ curved))
        small = np.linalg.norm(scale * bend) < 0.75 * np.linalg.norm(scale * step)
        return bend if small else np.zeros(len(step))

    def state(self, theta):
        found = self.rows(theta)
        rows, linear = found.rows, found.linear
        gram, right = rows @ rows.T, rows @ self.sensor
        gram[:len(linear), :len(linear)] += found.faint
        cost = found.residual @ found.residual + linear @ found.faint @ linear
        return _State(theta, float(cost), linear, gram, right, found.free_share)

    def explained(self, state):
        """Share of the output's power."""
        return 1 - state.cost / (len(self.sensor) * self.size**2)

    def require_relation(self, state):
        explained = self.explained(state)
        if explained < 0.5 and explained < _UNRELATED / self.independent():
            if explained > _SOME:
                raise IdentificationError(
                    f"the best model explains {explained:.0%} of the sensor's power only; the "
                    "motion has so few independent frequencies that chance could do as much: "
                    "whether both belong together is open; record longer, or with a wider band")
            raise IdentificationError(
                "the sensor's output has nothing to do with the reference: the best model explains "
                f"{max(explained, 0):.2%} of its power, which chance alone can do; were both "
                "recorded at the same time, with stamps of one clock?")

    def independent(self):
        """Number of independent frequencies that reference and sensor have in common."""
        full = np.zeros(self.n)
        full[self.judged] = self.sensor - self.sensor.mean()
        shared = np.abs(rfft(full))**2 * np.abs(rfft(self.reference - self.reference.mean()))**2
        return np.sum(shared)**2 / np.sum(shared**2)

    def second_order(self, own, covariance):
        """Second-order part of the variances of the physical parameters, shape (p,).

        Mean square of the quadratic terms of Gaussian unknowns with this covariance (JCGM 100:2008,
        5.1.2, note, has the variances). Where a damping order of about 1 is not well known, the
        first derivative of the damping ratio by it, which is nought there, tells nothing.
        """
        slopes = np.zeros((len(own),) * 3)
        for place, reach in enumerate(np.sqrt(np.maximum(np.diag(covariance), 0))):
            ends = np.clip(own + np.outer([1, -1], np.eye(len(own))[place] * reach),
                           self.low[:-1], self.high[:-1])
            if ends[0, place] > ends[1, place]:
                above, below = (self.structure.physical(end)[1] for end in ends)
                slopes[:, :, place] = (above - below) / (ends[0, place] - ends[1, place])
        quadratic = 0.5 * (slopes + slopes.transpose(0, 2, 1)) @ covariance
        return (0.5 * np.einsum("ijk,ikj->i", quadratic, quadratic)
                + 0.25 * np.einsum("ijj->i", quadratic)**2)

    def result(self, state, uncertainty=True):
        """The fit in physical units; without `uncertainty` its covariance is NaN."""
        theta, linear, count = state.theta, state.linear, len(state.linear)
        own, factors = self.structure.physical(theta[:-1])
        names = ("sensitivity", *self.structure.names, "delay_s", "offset")
        covariance = np.full((len(names), len(names)), np.nan)
        held = self.low == self.high
        stuck = ((theta <= self.low) | (theta >= self.high)) & ~held
        gradient, decay, second_order = None, np.nan, 0.0
        found = self.rows(theta)
        residual = found.residual
        if uncertainty:
            # changed in place, and never asked for again, as is what they were made with
            jacobian = found.rows
            self.rows_of.clear()
            self.convolution = self.prepared = None
            # the offset is what remains with the whole reference, not with the part that moves
            jacobian[0] += self.level
            jacobian[count:] *= linear[0]
            jacobian[count:-1] = np.linalg.inv(factors.T) @ jacobian[count:-1]
            jacobian[-1] *= self.rate
            # sensitivity, structure, delay, offset, free motions
            gradient = np.zeros((1 + len(jacobian) - count, self.n), np.float32)
            for row, place in zip(gradient, (0, *range(count, len(jacobian)))):
                row[self.judged] = jacobian[place]
            order = [0, *(count + np.flatnonzero(~held)), *range(1, count)]
            if found.swing is not None and (stuck.any() or not found.real):
                # what noise, or a tone that never decays, can feign of a swing tells no frequency
                order += [len(jacobian), len(jacobian) + 1]
                jacobian = found.room[:, :len(residual)]
                for row, part in zip(jacobian[-2:], (found.swing.real, found.swing.imag)):
                    np.multiply(self.instants[:len(part)], part, out=row[:len(part)])
            room = found.room[:len(jacobian)]
            if held.any():
                jacobian, order, room = jacobian[order], range(len(order)), None
            free = np.flatnonzero(np.r_[True, ~held, True])
            # the bound is ours, not the sensor's: how far the data would go is not known better
            beyond = solve(jacobian @ jacobian.T, jacobian @ residual) if stuck.any() \
                else np.zeros(len(jacobian))
            within = sandwich(jacobian.T, residual, self.used, room)
            within += np.outer(beyond, beyond)
            within = within[np.ix_(order, order)]
            covariance = np.zeros_like(covariance)
            covariance[np.ix_(free, free)] = within[:len(free), :len(free)]
            place = slice(1, 1 + len(own))
            spread = np.linalg.solve(factors, np.linalg.solve(factors, covariance[place, place]).T)
            second_order = np.zeros(len(names))
            second_order[place] = self.second_order(theta[:-1], spread)
            pole, slopes = self.structure.mode(theta[:-1])
            if pole is not None:
                variance = slopes.real @ spread @ slopes.real
                decay = 2 * np.sqrt(max(variance, 0)) - pole.real
        full = np.full(self.n, np.nan)
        full[self.used] = residual
        offset = linear[1] - linear[0] * self.level
        values = np.r_[linear[0], own, theta[-1] / self.rate, offset]
        at_bounds = tuple(name for name, here in zip((*self.structure.names, "delay_s"), stuck)
                          if here)
        return Fit(names, values, covariance, full, theta, at_bounds, gradient, state.free_share,
                   float(decay), second_order=second_order)


class _Rows(NamedTuple):
    """What a place in the search makes of all samples; not kept, as its rows are long.

    Attributes
    ----------
    room : ndarray, shape (p + 2, spectrum_room(n))
        The rows, each with what its spectrum needs more, and two that are free.
    rows : ndarray, shape (p, m)
        Simulated output, constant, free motions and derivatives by theta.
    linear : ndarray
        Coefficients of those before the derivatives.
    faint : ndarray
        What is known of them besides, as a normal matrix.
    residual : ndarray, shape (m,)
    swing : ndarray of complex, shape (l,), or None
        At the first samples, up to where nothing is left of it.
    real : bool
        Whether the swing is more than noise could feign.
    free_share : float
        Power of the free swing, of the output's; beside a forced one, it may exceed 1.
    """

    room: np.ndarray
    rows: np.ndarray
    linear: np.ndarray
    faint: np.ndarray
    residual: np.ndarray
    swing: np.ndarray | None
    real: bool
    free_share: float


@dataclasses.dataclass(frozen=True)
class _State:
    """A place in the search, by its normal equations."""

    theta: np.ndarray
    cost: float
    linear: np.ndarray
    gram: np.ndarray
    right: np.ndarray
    free_share: float
    converged: bool = False

    def reduced(self):
        """Normal matrix and slope of the unknowns, the linear coefficients eliminated."""
        count, gain = len(self.linear), self.linear[0]
        gram, across = self.gram, gain * self.gram[count:, :len(self.linear)]
        inner = gain**2 * gram[count:, count:] - across @ solve(gram[:count, :count], across.T)
        # the residual is orthogonal to the linear rows: only the slopes see it
        return inner, gain * self.right[count:] - across @ self.linear


class _AveragedResponse:
    """Fit to an averaged frequency response, of many starting points side by side."""

    def __init__(self, structure, s, prepared, response, weight, problem):
        self.structure, self.prepared, self.weight = structure, prepared, weight
        self.shift = -s / problem.rate
        self.wanted = _real(weight * response)
        self.free = np.array([name not in structure.held for name in structure.names] + [True])
        self.low, self.high = problem.low[:-1], problem.high[:-1]

    def improve(self, theta):
        """Damped Gauss-Newton steps from `theta`, shape (m, k + 1); costs and unknowns.

        What the structure keeps fixed here (a damping order) it finds in the time domain: the
        window's leakage looks like damping, and would lead it astray.
        """
        low = np.c_[np.tile(self.low, (len(theta), 1)), theta[:, -1] - 8]
        high = np.c_[np.tile(self.high, (len(theta), 1)), theta[:, -1] + 8]
        cost, gram, slope = self.evaluate(theta)
        damping = np.full(len(theta), 1e-3)
        for _ in range(_IMPROVEMENTS):
            diagonal = np.einsum("mii->mi", gram)
            damped = gram + np.eye(gram.shape[1]) * (
                damping[:, None] * diagonal + 1e-12 * diagonal.max(axis=1)[:, None])[:, None]
            step = np.linalg.solve(damped, slope[:, :, None])[:, 1:, 0]
            trial = theta.copy()
            trial[:, self.free] += np.clip(step, -0.7, 0.7)
            trial = np.clip(trial, low, high)
            new = self.evaluate(trial)
            better = new[0] < cost
            settled = np.all(np.where(better, cost - new[0] < 1e-3 * cost, damping > 1e3))
            theta = np.where(better[:, None], trial, theta)
            gram = np.where(better[:, None, None], new[1], gram)
            slope = np.where(better[:, None], new[2], slope)
            cost = np.where(better, new[0], cost)
            damping = np.where(better, damping / 5, damping * 10)
            if settled:
                break
        return cost, theta

    def evaluate(self, theta):
        """Costs (m,), normal matrices (m, p, p) and slopes (m, p) for the gain and what is free."""
        model, slopes = self.structure.gradient(self.prepared, theta[:, :-1].T[:, :, None])
        shift = self.weight * np.exp(self.shift * theta[:, -1:])
        parts = [part for part, kept in zip((*slopes, self.shift * model), self.free) if kept]
        rows = _real(np.stack([model, *parts], axis=1) * shift[:, None])
        gain = rows[:, 0] @ self.wanted / np.einsum("mf,mf->m", rows[:, 0], rows[:, 0])
        error = self.wanted - gain[:, None] * rows[:, 0]
        rows[:, 1:] *= gain[:, None, None]
        return (np.einsum("mf,mf->m", error, error), rows @ rows.transpose(0, 2, 1),
                np.einsum("mpf,mf->mp", rows, error))


def _real(values):
    return np.concatenate([values.real, values.imag], axis=-1)
