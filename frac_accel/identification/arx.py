"""Rational transfer function in z from a measured pair, by refined instrumental variables."""

import dataclasses

import numpy as np
from scipy.signal import lfilter

from ..core import Arx
from ..errors import IdentificationError
from .frequency_response import bulk_delay
from .uncertainty import sandwich

MOST_POLES = 4
MOST_ZEROS = 4
# What is asked of the excitation: the poles of one oscillator and as many numerator coefficients.
FEWEST_COEFFICIENTS = 4

# Orders of the long least-squares model whose output starts the search.
_LONG_POLES = 16
_LONG_INPUTS = 24
_ITERATIONS = 60
_SCAN_ITERATIONS = 4
# A step that gains this share of one sample's noise changes nothing that the data can tell.
_SMALL_GAIN = 1e-7
# The strongest stretch of a long record [samples] is enough to choose orders on.
_CHOICE_LENGTH = 16384
_LEARN = 0.6
# Standard errors by which a larger model must predict held-out data better.
_BETTER = 2.0
_BLOCKS = 32


@dataclasses.dataclass(frozen=True)
class Orders:
    """Numbers of coefficients, and whole samples before the first of the numerator acts."""

    poles: int
    inputs: int
    delay: int

    @property
    def coefficients(self):
        """Number of coefficients to be identified."""
        return self.poles + self.inputs


@dataclasses.dataclass(frozen=True)
class ArxFit:
    """Result of `fit_arx`; attributes as those of `output_error.Fit`.

    Attributes
    ----------
    names : tuple of str
        ``a1`` ..., ``b0`` ..., ``delay_s``, ``offset``.
    values, covariance, residual : ndarray
        The delay is chosen, not estimated: its row of the covariance is zero.
    unknowns : tuple
        Orders and coefficients, to start another fit from.
    orders : Orders
    sampling_rate_hz : float
    """

    names: tuple
    values: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray
    unknowns: tuple
    orders: Orders
    sampling_rate_hz: float

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

    def core(self):
        """Core of a sensor model, without the delay."""
        orders = self.orders
        degree = max(orders.poles, orders.inputs - 1)
        a, b = np.split(self.values[:orders.coefficients], [orders.poles])
        return Arx(tuple(np.pad(b, (0, degree + 1 - len(b))).tolist()),
                   tuple(np.pad(np.r_[1, a], (0, degree - len(a))).tolist()),
                   self.sampling_rate_hz)


def fit_arx(reference, sensor, sampling_rate_hz, valid=None, lag_s=0.0, start=None, most=None):
    r"""Coefficients of a rational transfer function in z, with a whole delay and an offset.

    Minimises the sum of the squared differences between the measured output and

    .. math:: y_k = \frac{b_0 + b_1 z^{-1} + \dots}{1 + a_1 z^{-1} + \dots} u_{k-d} + o + e_k

    (output error), where :math:`e_k` may have any spectrum. Least squares on the difference
    equation (L. Ljung, *System Identification*, 2nd ed., section 10.1) is biased by the noise, so
    a long model of this kind only starts the search. The answer comes from refined instrumental
    variables: the model's own noise-free output is the instrument, signals pass through
    :math:`1/A(z)`, and both are found anew until nothing changes (P. C. Young, A. J. Jakeman,
    *Int. J. Control* 29 (1979) 1-30, the simplified form). Its fixed point is the minimum above;
    where a step does not descend, the Gauss-Newton step with the same gradient does. Motion before
    the record enters as unknown initial values; instants without a sample take the model's output,
    so that they do not count; unstable poles are reflected into the unit circle.

    The model relates the samples as they are put on one grid. A lag of the sensor's grid is a
    property of the stamps and is added to ``delay_s``; any other fraction of a sample of delay
    has no parameter of its own and is what the numerator approximates in the excited band.

    Parameters
    ----------
    reference, sensor : ndarray, shape (n,)
    sampling_rate_hz : float
    valid : ndarray of bool, shape (n,), optional
        Samples that count.
    lag_s : float
        Time by which the sensor's instants are later than the reference's.
    start : tuple, optional
        `ArxFit.unknowns` of a fit whose orders are to be kept.
    most : int, optional
        Most coefficients that the excitation allows, where orders are to be chosen.

    Returns
    -------
    ArxFit

    Raises
    ------
    IdentificationError
        If no model predicts held-out data better than a constant does, or the record is too short.
    """
    valid = np.ones(len(sensor), bool) if valid is None else valid
    if start is None:
        start = _choose(*_strongest(reference, sensor, valid), most)
    orders, coefficients = start
    record = _Record(reference, sensor, valid, orders)
    problem = record.problem(orders)
    theta, _ = problem.search(coefficients)
    return _result(record, problem, orders, theta, sampling_rate_hz, lag_s)


def least_squares(reference, sensor, orders):
    """Coefficients a1 ..., b0 ... by least squares on the difference equation: biased by noise.

    L. Ljung, *System Identification*, 2nd ed., section 10.1.
    """
    valid = np.ones(len(sensor), bool)
    problem = _Record(reference, sensor, valid, orders).problem(orders)
    return problem.least_squares()[:orders.coefficients]


def _strongest(reference, sensor, valid):
    """Stretch of the record in which the reference has most energy."""
    if len(sensor) <= _CHOICE_LENGTH:
        return reference, sensor, valid
    energy = np.r_[0, np.cumsum(np.square(reference - reference.mean()))]
    first = int(np.argmax(energy[_CHOICE_LENGTH:] - energy[:-_CHOICE_LENGTH]))
    part = slice(first, first + _CHOICE_LENGTH)
    return reference[part], sensor[part], valid[part]


def _choose(reference, sensor, valid, most):
    """Orders and coefficients to start from.

    All orders are fitted to the first part of the record. In the order of their number of
    coefficients, a model replaces a smaller one only if its BIC is lower and it predicts the rest
    of the record better by two standard errors: BIC alone takes what a coloured residual pretends.
    """
    if len(sensor) < 20 * (MOST_POLES + MOST_ZEROS):
        raise IdentificationError(f"the record has {len(sensor)} samples, expected at least "
                                  f"{20 * (MOST_POLES + MOST_ZEROS)} to choose orders on")
    most = min(most or np.inf, MOST_POLES + MOST_ZEROS + 1)
    bulk = bulk_delay(reference, sensor)
    reach = min(_LONG_INPUTS, len(sensor) // 20)
    window = Orders(0, 0, bulk - reach), Orders(_LONG_POLES, 2 * reach, bulk - reach)
    record = _Record(reference, sensor, valid, *window)
    energy = np.cumsum(np.square(record.reference - record.reference.mean()))
    learn = slice(int(np.clip(np.searchsorted(energy, _LEARN * energy[-1]),
                              record.rows // 4, record.rows * 3 // 4)))
    long = record.problem(window[1], learn)
    long_output = long.simulate(long.stable(long.least_squares()))[0]

    inputs = min(MOST_ZEROS + 1, most - 1)
    poles = min(MOST_POLES, most - inputs)
    scanned = [_Trial.of(record, Orders(poles, inputs, delay), learn, long_output,
                         _SCAN_ITERATIONS)
               for delay in range(bulk - reach, bulk + 3)]
    earliest = min(scanned, key=lambda trial: trial.bic).orders.delay
    trials = [_Trial.of(record, Orders(poles, inputs, earliest + wait), learn, long_output)
              for poles in range(1, MOST_POLES + 1)
              for inputs in range(1, MOST_ZEROS + 2)
              for wait in range(MOST_ZEROS + 2 - inputs)
              if poles + inputs <= most]
    best = _Trial(Orders(0, 0, 0), None, np.inf, record.centred())
    for trial in sorted(trials, key=lambda trial: (trial.orders.coefficients, trial.bic)):
        same = trial.orders.coefficients == best.orders.coefficients
        if trial.bic < best.bic and (same or _better(trial.error, best.error, record.valid, learn)):
            best = trial
    if best.theta is None:
        raise IdentificationError(
            "the sensor's output has nothing to do with the reference: no transfer function of up "
            f"to {MOST_POLES} poles predicts held-out data better than a constant does")
    return best.orders, best.theta[:best.orders.coefficients]


@dataclasses.dataclass(frozen=True)
class _Trial:
    """A model fitted to the learning part, with its error over all rows."""

    orders: Orders
    theta: np.ndarray
    bic: float
    error: np.ndarray

    @classmethod
    def of(cls, record, orders, learn, long_output, iterations=_ITERATIONS):
        problem = record.problem(orders, learn)
        start = problem.instrumental(long_output)
        theta, cost = problem.search(start[:orders.coefficients], iterations)
        count = problem.used.sum()
        bic = count * np.log(cost / count) + (orders.coefficients + 1) * np.log(count)
        whole = record.problem(orders)
        return cls(orders, theta, bic, whole.sensor - whole.simulate(theta)[0])


def _better(error, other, valid, learn):
    """Whether one error is smaller than another on the rows after those learnt from."""
    rest = slice(learn.stop, None)
    gain = np.where(valid, other**2 - error**2, 0.0)[rest]
    blocks = np.array([block.mean() for block in np.array_split(gain, _BLOCKS)])
    return blocks.mean() > _BETTER * blocks.std(ddof=1) / np.sqrt(_BLOCKS)


class _Record:
    """The rows of a record for which all delayed inputs exist, less their means."""

    def __init__(self, reference, sensor, valid, *orders):
        latest = max(0, max(order.delay + order.inputs - 1 for order in orders))
        earliest = min(0, min(order.delay for order in orders))
        self.first, self.stop = latest, len(sensor) + earliest
        self.rows = self.stop - self.first
        if self.rows < 10 * max(order.coefficients for order in orders):
            raise IdentificationError(
                f"{self.rows} samples are left behind a delay of {max(latest, -earliest)}: too few")
        kept = slice(self.first, self.stop)
        self.length = len(sensor)
        self.valid = valid[kept]
        self.level, self.mean = reference.mean(), sensor[kept][self.valid].mean()
        self.all = reference - self.level
        self.reference, self.sensor = self.all[kept], sensor[kept] - self.mean

    def problem(self, orders, part=slice(None)):
        inputs = np.ones((orders.inputs + 1, self.rows))
        for i in range(orders.inputs):
            begin = self.first - orders.delay - i
            inputs[i] = self.all[begin:begin + self.rows]
        return _Problem(orders.poles, inputs[:, part], self.sensor[part], self.valid[part])

    def centred(self):
        return np.where(self.valid, self.sensor, 0.0)


class _Problem:
    """Fit of A y = B u + c + initial values; theta is (a, b, c, initial values).

    The initial values are the right-hand side's first rows: one for each pole.
    """

    def __init__(self, poles, inputs, sensor, valid):
        self.poles, self.inputs, self.sensor, self.used = poles, inputs, sensor, valid
        self.rows = len(sensor)

    def split(self, theta):
        return np.split(theta, [self.poles, self.poles + len(self.inputs)])

    def stable(self, theta):
        """Coefficients with the poles that are not inside the unit circle reflected into it."""
        a, rest = theta[:self.poles], theta[self.poles:]
        poles = np.roots(np.r_[1, a])
        size = np.abs(poles)
        if np.all(size < 1):
            return theta
        inside = np.minimum(1 / np.maximum(size, 1), 1 - 1 / self.rows)
        poles = np.where(size < 1, poles, poles / np.maximum(size, 1) * inside)
        return np.r_[np.poly(poles).real[1:], rest]

    def simulate(self, theta):
        """Output without noise, and the denominator."""
        a, b, initial = self.split(theta)
        right = b @ self.inputs
        right[:self.poles] += initial
        denominator = np.r_[1, a]
        return lfilter([1], denominator, right), denominator

    def columns(self, output, denominator=None):
        """Derivatives of the model by theta where its output is `output`, shape (rows, p)."""
        signals = np.concatenate([-output[None], self.inputs, np.zeros((1, self.rows))])
        signals[-1, 0] = 1
        if denominator is not None:
            signals = lfilter([1], denominator, signals, axis=1)
        columns = np.zeros((self.rows, 2 * self.poles + len(self.inputs)))
        for i in range(self.poles):
            columns[i + 1:, i] = signals[0, :self.rows - i - 1]
            columns[i:, self.poles + len(self.inputs) + i] = signals[-1, :self.rows - i]
        columns[:, self.poles:self.poles + len(self.inputs)] = signals[1:-1].T
        return columns

    def least_squares(self):
        return self.instrumental(self.sensor)

    def instrumental(self, output):
        """Estimate with another model's output as instrument; least squares with the measured."""
        # a missing sample spoils the rows in which it is a regressor
        used = np.convolve(~self.used, np.ones(self.poles + 1))[:self.rows] == 0
        instruments, regressors = self.columns(output)[used], self.columns(self.sensor)[used]
        return _solve(instruments.T @ regressors, instruments.T @ self.sensor[used],
                      np.sum(instruments**2, axis=0))

    def search(self, coefficients, iterations=_ITERATIONS):
        """Refined instrumental variables from given a, b; (theta, cost)."""
        theta = np.zeros(2 * self.poles + len(self.inputs))
        theta[:len(coefficients)] = coefficients
        theta = self.stable(theta)
        # constant and initial values are linear: with the wrong ones the first step would be lost
        gradient = self.columns(*self.simulate(theta))
        _, linear = self.evaluate(theta)[:2], slice(len(coefficients), None)
        error = np.where(self.used, self.sensor - self.simulate(theta)[0], 0.0)
        own = gradient[self.used][:, linear]
        theta[linear] = _solve(own.T @ own, own.T @ error[self.used], np.sum(own**2, axis=0))
        cost, error, output, denominator = self.evaluate(theta)
        for _ in range(iterations):
            gradient = self.columns(output, denominator)
            filled = np.where(self.used, self.sensor, output)
            right = gradient.T @ error
            size = np.sum(gradient**2, axis=0)
            gradient_used = gradient if self.used.all() else gradient[self.used]
            for matrix in (gradient.T @ self.columns(filled, denominator),
                           gradient_used.T @ gradient_used):
                step = _solve(matrix, right, size)
                found = self.descend(theta, step, cost)
                if found is not None:
                    break
            else:
                break
            gained = cost - found[1][0]
            theta, (cost, error, output, denominator) = found
            if gained < _SMALL_GAIN * cost / self.rows:
                break
        return theta, cost

    def descend(self, theta, step, cost):
        """Longest of the step's halvings that lowers the cost, and what it leads to."""
        for share in (1.0, 0.5, 0.2, 0.05, 0.01):
            trial = self.stable(theta + share * step)
            new = self.evaluate(trial)
            if new[0] < cost:
                return trial, new
        return None

    def evaluate(self, theta):
        output, denominator = self.simulate(theta)
        error = np.where(self.used, self.sensor - output, 0.0)
        return float(error @ error), error, output, denominator


def _result(record, problem, orders, theta, rate, lag_s):
    output, denominator = problem.simulate(theta)
    residual = (problem.sensor - output)[problem.used]
    gradient = problem.columns(output, denominator)[problem.used]
    # initial motion that is over at once determines its coefficients badly, and nothing else
    gradient = gradient[:, np.linalg.norm(gradient, axis=0) > 0]
    covariance = sandwich(gradient, residual, problem.used)
    a, b, _ = problem.split(theta)
    b, constant = b[:-1], b[-1]
    # offset = mean output + c / A(1) - B(1) / A(1) * mean input, and its derivatives
    static = 1 / denominator.sum()
    gain = b.sum() * static
    offset = record.mean + constant * static - gain * record.level
    by_theta = np.r_[np.full(len(a), -(constant - b.sum() * record.level) * static**2),
                     np.full(len(b), -record.level * static), static]
    count = orders.coefficients
    factors = np.zeros((count + 2, len(covariance)))
    factors[:count, :count] = np.eye(count)
    factors[-1, :count + 1] = by_theta
    full = np.full(record.length, np.nan)
    full[record.first:record.stop][problem.used] = residual
    names = (*(f"a{i + 1}" for i in range(len(a))), *(f"b{i}" for i in range(len(b))),
             "delay_s", "offset")
    values = np.r_[a, b, orders.delay / rate + lag_s, offset]
    return ArxFit(names, values, factors @ covariance @ factors.T, full,
                  (orders, theta[:count]), orders, rate)


def _solve(matrix, right, size):
    """Solution of a normal system with columns of squared length `size`; of least length."""
    scale = np.sqrt(np.maximum(size, 1e-300))
    scaled = matrix / np.outer(scale, scale)
    return np.linalg.lstsq(scaled, right / scale, rcond=1e-11)[0] / scale
