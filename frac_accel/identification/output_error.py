"""Output-error fit of a continuous-time model structure to a measured pair, in the time domain."""

import dataclasses

import numpy as np
from scipy.fft import rfft

from ..errors import IdentificationError
from ..simulation import Convolution
from .excitation import strongest_stretch
from .frequency_response import averaged_response, bulk_delay
from .uncertainty import sandwich

# Samples at both ends that the band-limited simulation cannot know, besides the unknown start.
_EDGE = 32
_ITERATIONS = 60
# A step this small against the standard uncertainties changes nothing that the data can tell.
_SMALL_STEP = 1e-3
_IMPROVEMENTS = 25
_SEARCHES = 2
# Error of a start on the averaged response, over the best one's, with which it leads nowhere.
_HOPELESS = 1.5
_START_LENGTH = 16384
_TRIAL_ITERATIONS = 4
# Share of the output's power, times the number of independent frequencies, that the best of all
# resonances and delays still explains of an unrelated signal.
_CHANCE = 10


@dataclasses.dataclass(frozen=True)
class Fit:
    """Result of `fit_output_error`.

    Attributes
    ----------
    names : tuple of str
        ``sensitivity``, the structure's parameters, ``delay_s``, ``offset``.
    values : ndarray, shape (p,)
    covariance : ndarray, shape (p, p)
        Allows for a residual that is not white.
    residual : ndarray, shape (n,)
        Measured less simulated [output units]; NaN where not judged.
    unknowns : ndarray
        Where the search ended, in its own coordinates.
    """

    names: tuple
    values: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray
    unknowns: np.ndarray

    @property
    def std(self):
        """Standard uncertainties, shape (p,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0))

    @property
    def rmse(self):
        """RMS of the residual [output units]."""
        return float(np.sqrt(np.nanmean(self.residual**2)))

    def __getitem__(self, name):
        return float(self.values[self.names.index(name)])


def fit_output_error(structure, reference, sensor, sampling_rate_hz, valid=None, lag_s=0.0,
                     start=None):
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

    Returns
    -------
    Fit

    Raises
    ------
    IdentificationError
        If the best model explains no more than chance would.
    """
    if start is None and len(sensor) > _START_LENGTH:
        # where the motion is strongest is enough to find out roughly where the parameters are
        part = strongest_stretch(reference, _START_LENGTH, valid)
        start = _Problem(structure, reference[part], sensor[part], sampling_rate_hz,
                         None if valid is None else valid[part], lag_s).solve(None).unknowns
    return _Problem(structure, reference, sensor, sampling_rate_hz, valid, lag_s).solve(start)


class _Problem:
    """Unknowns of the search: the structure's own and the delay in samples."""

    def __init__(self, structure, reference, sensor, rate, valid, lag_s):
        self.structure, self.rate, self.lag_s = structure, rate, lag_s
        self.n = len(sensor)
        # the first value is taken as steady before the record: its response is a constant
        self.level = reference[0]
        self.convolution = Convolution(reference - self.level, rate, 2 * _EDGE / rate)
        self.prepared = structure.prepare(self.convolution.s)
        self.time = np.arange(self.n) / rate
        used = np.ones(self.n, bool) if valid is None else valid.copy()
        used[:min(_EDGE, self.n // 8)] = False
        used[-min(_EDGE, self.n // 8):] = False
        self.used = used
        self.all_used = slice(min(_EDGE, self.n // 8), self.n - min(_EDGE, self.n // 8)) \
            if used.sum() == self.n - 2 * min(_EDGE, self.n // 8) else used
        self.sensor = sensor[self.all_used]
        self.size = float(np.std(self.sensor))
        if self.size**2 == 0:
            raise IdentificationError("the sensor's output is constant where it counts")
        self.reference = reference
        self.whole = sensor

    def solve(self, start):
        starts = self.starts() if start is None else [start]
        if self.structure.held and start is None:
            trials = [self.search(theta, held=True) for theta in starts]
            starts = [trial[1] for trial in sorted(trials, key=lambda trial: trial[0])[:_SEARCHES]]
        best = None
        for start in starts:
            found = self.search(start)
            if best is None or found[0] < best[0] * (1 - 1e-9):
                best = found
        cost, theta, linear, matrix = best
        self.require_relation(1 - cost / (len(self.sensor) * self.size**2))
        return self.result(theta, linear, matrix)

    def starts(self):
        """Most promising starting points: the grid's best, improved on the averaged response."""
        bulk = bulk_delay(self.reference, self.whole)
        frequency, response, weight = averaged_response(self.reference, self.whole, self.rate, bulk)
        s = 2j * np.pi * frequency
        prepared = self.structure.prepare(s)
        peak = frequency[np.argmax(np.abs(response))]
        grid = self.structure.grid(frequency[0], frequency[-1], peak)
        models = np.stack([self.structure.gradient(prepared, point)[0] for point in grid])
        # the correlation may have peaked half a period of the resonance away from the delay
        energy = weight * np.abs(response)**2
        reach = 0.75 * self.rate * np.sum(energy) / np.sum(energy * frequency) + 2
        step = max(0.25, self.rate / (8 * frequency[-1]), reach / 100)
        delays = np.arange(-reach, reach + step, step)
        turned = (weight * response)[:, None] * np.exp(np.outer(s, delays) / self.rate)
        shared = np.real(np.conj(models) @ turned)
        explained = shared**2 / (np.abs(models)**2 @ weight)[:, None]
        held = [name in self.structure.held for name in self.structure.names]
        best_delay = np.argmax(explained, axis=1)
        explained = np.max(explained, axis=1)
        chosen, seen = [], {}
        for point in np.argsort(explained)[::-1]:
            # neighbours in frequency end in the same place; other dampings may not
            kind = *np.round(grid[point][1:], 3), round(grid[point][0], 1)
            group = seen.setdefault(tuple(grid[point][held]), set())
            if kind not in group and len(group) < self.structure.starting_points:
                group.add(kind)
                chosen.append(np.r_[grid[point], delays[best_delay[point]]])
        improved = [self.improve(theta, s, prepared, response, np.sqrt(weight))
                    for theta in chosen]
        # half a period of the resonance, with the other polarity, looks much the same
        best = min(improved, key=lambda pair: pair[0])[1]
        half = np.r_[np.zeros(len(best) - 1), self.rate / (2 * peak)]
        improved += [self.improve(theta, s, prepared, response, np.sqrt(weight))
                     for theta in (best - half, best + half)]
        improved.sort(key=lambda pair: pair[0])
        lag = bulk + self.lag_s * self.rate
        best = {}
        hopeless = _HOPELESS * improved[0][0]
        for cost, theta in improved:
            if cost > hopeless and not any(held):
                break
            group = best.setdefault(tuple(theta[:-1][held]), [])
            start = np.r_[theta[:-1], theta[-1] + lag]
            known = any(np.max(np.abs(start - other)) < 0.05 for other in group)
            if len(group) < self.structure.searches and not known:
                group.append(start)
        return [theta for group in best.values() for theta in group]

    def improve(self, theta, s, prepared, response, weight):
        """A few damped Gauss-Newton steps on the averaged response; (cost, unknowns).

        What the structure keeps fixed here (a damping order) it finds in the time domain: the
        window's leakage looks like damping, and would lead it astray.
        """
        free = np.r_[[name not in self.structure.held for name in self.structure.names], True]
        low, high = self.structure.bounds(self.rate, self.n)
        low, high = np.r_[low, theta[-1] - 8], np.r_[high, theta[-1] + 8]
        wanted = _real(weight * response)

        def evaluate(theta):
            model, slopes = self.structure.gradient(prepared, theta[:-1])
            shift = weight * np.exp(-s * theta[-1] / self.rate)
            parts = [model, *(part for part, kept in
                              zip((*slopes, -s / self.rate * model), free) if kept)]
            columns = np.stack([_real(part * shift) for part in parts], axis=1)
            gain = columns[:, 0] @ wanted / (columns[:, 0] @ columns[:, 0])
            error = wanted - gain * columns[:, 0]
            return error @ error, columns * np.r_[1, np.full(free.sum(), gain)], error

        cost, columns, error = evaluate(theta)
        damping = 1e-3
        for _ in range(_IMPROVEMENTS):
            gram = columns.T @ columns
            step = _solve(gram + damping * np.diag(np.diag(gram)), columns.T @ error)[1:]
            trial = theta.copy()
            trial[free] += np.clip(step, -0.7, 0.7)
            trial = np.clip(trial, low, high)
            new = evaluate(trial)
            if new[0] < cost:
                small = cost - new[0] < 1e-6 * cost
                theta, (cost, columns, error), damping = trial, new, damping / 5
                if small:
                    break
            else:
                damping *= 10
                if damping > 1e6:
                    break
        return cost, theta

    def columns(self, theta):
        """Matrix of (simulated output, constant, free motions, derivatives by theta)."""
        own, delay = theta[:-1], theta[-1] / self.rate - self.lag_s
        response, slopes = self.structure.gradient(self.prepared, own)
        shift = np.exp(-self.convolution.s * delay)
        response = response * shift
        spectra = [response, *(slope * shift for slope in slopes),
                   response * (-self.convolution.s / self.rate)]
        simulated = [self.convolution.response(spectrum)[self.all_used] for spectrum in spectra]
        free = [motion[self.all_used] for motion in self.structure.free_motions(own, self.time)]
        # a free motion that is over before the first used sample is none
        free = [motion for motion in free if np.max(np.abs(motion)) > 1e-9]
        linear = [simulated[0], np.ones(len(self.sensor)), *free]
        return np.stack(linear + simulated[1:], axis=1), len(linear)

    def search(self, theta, held=False):
        """Levenberg-Marquardt; (cost, theta, linear coefficients, last matrix).

        With `held` a few steps only, in which what the structure holds back stays.
        """
        fixed = np.array([held and name in self.structure.held
                          for name in (*self.structure.names, "delay_s")])
        low, high = self.structure.bounds(self.rate, self.n)
        low, high = np.r_[low, -self.n / 4], np.r_[high, self.n / 4]
        theta = np.clip(theta, low, high)
        damping, state = 0.0, self.evaluate(theta)
        for _ in range(_TRIAL_ITERATIONS if held else _ITERATIONS):
            cost, linear, matrix, count, gram, right = state
            # derivatives by theta carry the sensitivity
            scale = np.r_[np.ones(count), np.full(len(theta), linear[0])]
            gram_scaled, right_scaled = gram * np.outer(scale, scale), right * scale
            inner = gram_scaled[count:, count:] - gram_scaled[count:, :count] @ _solve(
                gram_scaled[:count, :count], gram_scaled[:count, count:])
            # the residual is orthogonal to the linear columns: only the slopes see it
            slope = right_scaled[count:] - gram_scaled[count:, :count] @ linear
            inner[fixed] = inner[:, fixed] = 0.0
            slope[fixed] = 0.0
            diagonal = np.diag(np.diag(inner))
            moved = False
            for _ in range(12):
                step = _solve(inner + damping * diagonal, slope)
                trial = np.clip(theta + np.clip(step, -1, 1), low, high)
                new = self.evaluate(trial)
                if new[0] < cost:
                    moved = True
                    break
                if abs(slope @ step) < 1e-12 * cost:
                    break
                damping = max(4 * damping, 1e-3)
            if not moved:
                break
            gained = cost - new[0]
            theta, state, damping = trial, new, damping / 10 if damping > 1e-9 else 0.0
            # a gain this small against the noise, by an undamped step: nothing is left to find
            if damping < 1e-3 and gained < _SMALL_STEP**2 * new[0] / len(self.sensor):
                break
        cost, linear, matrix = state[0], state[1], state[2]
        return cost, theta, linear, matrix

    def evaluate(self, theta):
        matrix, count = self.columns(theta)
        gram = matrix.T @ matrix
        right = matrix.T @ self.sensor
        linear = _solve(gram[:count, :count], right[:count])
        residual = self.sensor - matrix[:, :count] @ linear
        return float(residual @ residual), linear, matrix, count, gram, right

    def require_relation(self, explained):
        if explained < min(_CHANCE / self.independent(), 0.5):
            raise IdentificationError(
                "the sensor's output has nothing to do with the reference: the best model explains "
                f"{max(explained, 0):.2%} of its power, which chance alone can do")

    def independent(self):
        """Number of independent frequencies that reference and sensor have in common."""
        full = np.zeros(self.n)
        full[self.all_used] = self.sensor - self.sensor.mean()
        shared = np.abs(rfft(full))**2 * np.abs(rfft(self.reference - self.reference.mean()))**2
        return np.sum(shared)**2 / np.sum(shared**2)

    def result(self, theta, linear, matrix):
        count = len(linear)
        jacobian = matrix.copy()
        jacobian[:, count:] *= linear[0]
        residual = self.sensor - matrix[:, :count] @ linear
        own, factors = self.structure.physical(theta[:-1])
        jacobian[:, count:-1] = jacobian[:, count:-1] @ np.linalg.inv(factors)
        jacobian[:, -1] *= self.rate
        # sensitivity, structure, delay, offset, free motions
        order = [0, *range(count, jacobian.shape[1]), *range(1, count)]
        covariance = sandwich(jacobian[:, order], residual, self.used)
        full = np.full(self.n, np.nan)
        full[self.used] = residual
        offset = linear[1] - linear[0] * self.level
        values = np.r_[linear[0], own, theta[-1] / self.rate, offset]
        names = ("sensitivity", *self.structure.names, "delay_s", "offset")
        keep = len(names)
        return Fit(names, values, covariance[:keep, :keep], full, theta)


def _real(values):
    return np.r_[values.real, values.imag]


def _solve(matrix, right):
    """Solution of a scaled normal system, of least length where it is singular."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(scale, scale)
    divided = right / (scale if right.ndim == 1 else scale[:, None])
    solved = np.linalg.lstsq(scaled, divided, rcond=1e-12)[0]
    return solved / (scale if right.ndim == 1 else scale[:, None])
