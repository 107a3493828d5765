"""Rational transfer function in z from a measured pair, by refined instrumental variables."""

import dataclasses

import numpy as np

from ...errors import IdentificationError
from ...model.core import Arx
from ...signals.normal_equations import solve
from ..response.excitation import (
    alternating_stretches,
    highest_excited,
    persistent_excitation,
    strongest_stretch,
)
from ..response.frequency_response import bulk_delay
from .continuous_poles import METHOD, continuous_poles
from .output_error import Fit
from .uncertainty import sandwich

# Largest orders that are tried.
MOST_POLES = 4
MOST_ZEROS = 7
# Ratio of singular values below which a direction is none.
_SINGULAR = 1e-11
# What is asked of the excitation: the poles of one oscillator and as many numerator coefficients.
FEWEST_COEFFICIENTS = 4

# Orders of the long least-squares model whose output starts the search.
_LONG_POLES = 16
_LONG_INPUTS = 24
_ITERATIONS = 60
_SCAN_ITERATIONS = 2
_TRIAL_ITERATIONS = 20
# A step that gains this share of one sample's noise changes nothing that the data can tell; for the
# choice of orders, which weighs gains of several samples' noise, less will do.
_SMALL_GAIN = 1e-7
_SMALL_GAIN_OF_TRIAL = 0.1
# The strongest stretch of a long record [samples] is enough to choose orders on.
_CHOICE_LENGTH = 16384
# Standard errors by which a larger model must predict held-out data better. What a model lacks is
# not in its uncertainty, while what it has too much is: the test is mild.
_BETTER = 1.0
# The same against a constant: below, chance alone finds one among all orders and delays.
_RELATED = 5.0
_BLOCKS = 32
# Stretches of equal energy that are learnt from and held out in turn, for the choice of orders.
_STRETCHES = 16
# BIC above the best so far from which a model of that size is not fitted: odds of exp(10).
_HOPELESS = 20.0
# Time constants in a record, at least, of a pole above all excited frequencies.
_SHORT = 30.0


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
class ArxFit(Fit):
    """Result of `fit_arx`.

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
    lag_s : float
        Part of the delay that the stamps have, not the samples.
    """

    orders: Orders
    sampling_rate_hz: float
    lag_s: float

    def core(self):
        """Core of a sensor model, without the delay."""
        orders = self.orders
        degree = max(orders.poles, orders.inputs - 1)
        a, b = np.split(self.values[:orders.coefficients], [orders.poles])
        return Arx(tuple(np.pad(b, (0, degree + 1 - len(b))).tolist()),
                   tuple(np.pad(np.r_[1, a], (0, degree - len(a))).tolist()),
                   self.sampling_rate_hz)

    def continuous_equivalent(self):
        """Method of the mapping to s, and the oscillators that it gives (`continuous_poles`)."""
        count = self.orders.poles
        return {"method": METHOD,
                "poles": continuous_poles(np.r_[1, self.values[:count]],
                                          self.covariance[:count, :count], self.sampling_rate_hz)}

    def notes(self):
        """What a user must know of orders, delay and meaning of the coefficients."""
        orders = self.orders
        stamps = f" and the {self.lag_s:.3g} s by which the sensor's stamps are later than the " \
                 "reference's" if abs(self.lag_s) * self.sampling_rate_hz > 1e-3 else ""
        pairs = [f"{pair['natural_frequency_hz']['value']:.5g} ± "
                 f"{pair['natural_frequency_hz']['std']:.2g} Hz with damping ratio "
                 f"{pair['damping_ratio']['value']:.4g} ± {pair['damping_ratio']['std']:.2g}"
                 for pair in self.continuous_equivalent()["poles"]]
        return [
            f"{orders.poles} pole(s) and {orders.inputs} numerator coefficient(s), chosen by BIC "
            "and on held-out data, with one more than needed at either end of the numerator where "
            "the excitation allows: their bias is small against the uncertainties",
            f"delay_s is {orders.delay} whole sample(s){stamps}, chosen and not estimated; a "
            "fraction of a sample that is the sensor's own is approximated by the numerator",
            f"the coefficients hold in z at {self.sampling_rate_hz:.6g} Hz only; in s the model "
            f"has {'; '.join(pairs) or 'no oscillating poles'} ({METHOD})"]


class ArxStructure:
    """Rational transfer function in z; its orders belong to each fit."""

    names = ()

    def core(self, fit):
        """Core of a sensor model."""
        return fit.core()


def fit_arx(reference, sensor, sampling_rate_hz, valid=None, lag_s=0.0, start=None,
            uncertainty=True):
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
    uncertainty : bool
        Whether the covariance is wanted; NaN otherwise.

    Returns
    -------
    ArxFit

    Raises
    ------
    IdentificationError
        If no model predicts held-out data better than a constant does, or the record is too short.

    Notes
    -----
    Orders, where `start` does not give them, are chosen by BIC and on held-out data among up to
    `MOST_POLES` poles and `MOST_ZEROS` zeros, with no more coefficients than the excitation is
    persistently exciting of; the numerator is then given one more coefficient at either end, so
    that what the choice cannot see is small against the uncertainties.
    """
    valid = np.ones(len(sensor), bool) if valid is None else valid
    if start is None:
        most = persistent_excitation(reference, sampling_rate_hz)[0]
        part = strongest_stretch(reference, _CHOICE_LENGTH, valid)
        start = _choose(reference[part], sensor[part], valid[part], most)
    orders, coefficients = start
    record = _Record(reference, sensor, valid, orders)
    problem = record.problem(orders)
    theta, _ = problem.search(coefficients)
    return _result(record, problem, orders, theta, sampling_rate_hz, lag_s, uncertainty)


def least_squares(reference, sensor, orders):
    """Coefficients a1 ..., b0 ... by least squares on the difference equation: biased by noise.

    L. Ljung, *System Identification*, 2nd ed., section 10.1.
    """
    valid = np.ones(len(sensor), bool)
    problem = _Record(reference, sensor, valid, orders).problem(orders)
    return problem.least_squares()[:orders.coefficients]


def _choose(reference, sensor, valid, most):
    """Orders and coefficients to start from.

    Models of all orders are fitted to every other stretch of the record. By growing number of
    coefficients, a model replaces a smaller one only if its BIC is lower and it predicts the other
    stretches better by a standard error: BIC alone takes what a coloured residual pretends.
    """
    if len(sensor) < 20 * (MOST_POLES + MOST_ZEROS):
        raise IdentificationError(f"the record has {len(sensor)} samples, expected at least "
                                  f"{20 * (MOST_POLES + MOST_ZEROS)} to choose orders on")
    largest = min(most, MOST_POLES + MOST_ZEROS + 1)
    bulk = bulk_delay(reference, sensor)
    reach = min(_LONG_INPUTS, len(sensor) // 20)
    window = Orders(0, 0, bulk - reach), Orders(_LONG_POLES, 2 * reach, bulk - reach)
    record = _Record(reference, sensor, valid, *window)
    record.hold_out(alternating_stretches(record.reference, _STRETCHES))
    long = record.problem(window[1], record.learn)
    long_output = long.simulate(long.stable(long.least_squares()))[0]

    inputs = min(MOST_ZEROS + 1, largest - 1)
    poles = min(MOST_POLES, largest - inputs)
    scanned = [_Trial.of(record, Orders(poles, inputs, delay), long_output, _SCAN_ITERATIONS)
               for delay in range(bulk - reach, bulk + 3)]
    # the first coefficients may be nought: of the delays that do equally well, the longest
    enough = min(trial.bic for trial in scanned) + np.log(record.rows)
    earliest = max(trial.orders.delay for trial in scanned if trial.bic <= enough)
    return _widened(_best(_trials(record, long_output, earliest, largest), record), most)


def _best(trials, record):
    """Largest of the models that each improve on a smaller one."""
    constant = _Trial(Orders(0, 0, 0), np.zeros(0), np.inf, np.inf, np.inf, record.centred())
    best = constant
    for trial in sorted(trials, key=lambda trial: (trial.orders.coefficients, trial.overall)):
        larger = trial.orders.coefficients > best.orders.coefficients
        if larger and trial.bic < best.bic and record.gain(trial.error, best.error) > _BETTER:
            best = trial
    if best is constant or record.gain(best.error, constant.error) < _RELATED:
        raise IdentificationError(
            f"no transfer function of up to {MOST_POLES} poles predicts held-out stretches of the "
            "record better than a constant does: the sensor's output has nothing to do with the "
            "reference")
    return best


def _trials(record, long_output, earliest, most):
    """Models of all orders that can be the best, from the largest to the smallest.

    One is left out where even the residual of a larger model that contains it would give it a
    hopeless BIC.
    """
    trials, least, best = [], {}, np.inf
    for poles in range(MOST_POLES, 0, -1):
        for inputs in range(min(MOST_ZEROS + 1, most - poles), 0, -1):
            for wait in range(MOST_ZEROS + 2 - inputs):
                larger = ((poles + 1, inputs, wait), (poles, inputs + 1, wait),
                          (poles, inputs + 1, wait - 1))
                cost = max(least.get(key, 0.0) for key in larger)
                orders = Orders(poles, inputs, earliest + wait)
                if record.bic(cost, orders) < best + _HOPELESS:
                    trial = _Trial.of(record, orders, long_output)
                    trials.append(trial)
                    cost, best = max(cost, trial.cost), min(best, trial.bic)
                least[poles, inputs, wait] = cost
    return trials


def _widened(trial, most):
    """The chosen model's orders and coefficients, its numerator wider by one at either end.

    A choice of orders tolerates a bias as large as the standard errors, so that intervals given
    these orders cover too little. One step beyond the chosen the bias is small against them
    ("undersmoothing": P. Hall, *Ann. Statist.* 20 (1992) 675-694). More poles would not do: where
    they are too many, zeros cancel them and neither is determined.
    """
    orders, coefficients = trial.orders, trial.theta[:trial.orders.coefficients]
    if orders.coefficients + 2 > most:
        return orders, coefficients
    a, b = np.split(coefficients, [orders.poles])
    return Orders(orders.poles, orders.inputs + 2, orders.delay - 1), np.r_[a, 0, b, 0]


@dataclasses.dataclass(frozen=True)
class _Trial:
    """A model fitted to the learning rows, with its squared error there and its error everywhere.

    `overall` is its BIC with the log-likelihood of the rest added: between equally large models.
    """

    orders: Orders
    theta: np.ndarray
    cost: float
    bic: float
    overall: float
    error: np.ndarray

    @classmethod
    def of(cls, record, orders, long_output, iterations=_TRIAL_ITERATIONS):
        problem = record.problem(orders, record.learn)
        start = problem.instrumental(long_output)
        theta, cost = problem.search(start[:orders.coefficients], iterations,
                                     _SMALL_GAIN_OF_TRIAL)
        error = np.where(record.valid, record.sensor - problem.simulate(theta)[0], 0.0)
        bic, rest = record.bic(cost, orders), error[record.rest]
        overall = bic + len(rest) * np.log(max(rest @ rest, 1e-300) / len(rest))
        return cls(orders, theta, cost, bic, overall, error)


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
        self.highest = 2 * np.pi * highest_excited(reference)

    def problem(self, orders, used=True):
        inputs = np.ones((orders.inputs + 1, self.rows))
        for i in range(orders.inputs):
            begin = self.first - orders.delay - i
            inputs[i] = self.all[begin:begin + self.rows]
        return _Problem(orders.poles, inputs, self.sensor, self.valid & used, self.highest)

    def centred(self):
        return np.where(self.valid, self.sensor, 0.0)

    def hold_out(self, rest):
        """Take the rows of the mask `rest` for judging, the others for learning."""
        self.rest, self.learn = self.valid & rest, self.valid & ~rest

    def bic(self, cost, orders):
        """Bayesian information criterion of a model with the squared error `cost` where learnt."""
        count = self.learn.sum()
        return (count * np.log(max(cost, 1e-300) / count)
                + (orders.coefficients + 1) * np.log(count))

    def gain(self, error, other):
        """By how many standard errors `error` is smaller than `other` where not learnt."""
        error, other = error[self.rest], other[self.rest]
        energy = np.cumsum(other**2 + error**2)
        # blocks of equal energy: a shock is a few strong samples and a long quiet
        edges = np.unique(np.searchsorted(energy, np.arange(_BLOCKS) / _BLOCKS * energy[-1]))
        blocks = np.add.reduceat(other**2 - error**2, edges)
        return blocks.mean() / max(blocks.std(ddof=1) / np.sqrt(len(blocks)), 1e-300)


class _Problem:
    """Fit of A y = B u + c + initial values; theta is (a, b, c, initial values).

    The initial values are the right-hand side's first rows: one for each pole.
    """

    def __init__(self, poles, inputs, sensor, valid, highest):
        self.poles, self.inputs, self.sensor, self.used = poles, inputs, sensor, valid
        self.highest = highest
        self.rows = len(sensor)

    def split(self, theta):
        return np.split(theta, [self.poles, self.poles + len(self.inputs)])

    def stable(self, theta):
        """Coefficients with the poles that are not inside the unit circle reflected into it.

        A pole above all excited frequencies must not ring on either: it would imitate noise by its
        initial values alone. A slow one below them, as of AC coupling, shows in the phase above it.
        """
        a, rest = theta[:self.poles], theta[self.poles:]
        poles = np.roots(np.r_[1, a])
        size = np.abs(poles)
        most = 1 - np.where(np.abs(np.angle(poles)) > self.highest, _SHORT, 1.0) / self.rows
        inside = np.minimum(np.where(size < 1, size, 1 / np.maximum(size, 1)), most)
        if np.all((size < 1) & (inside == size)):
            return theta
        return np.r_[np.poly(poles / np.maximum(size, 1e-300) * inside).real[1:], rest]

    def simulate(self, theta):
        """Output without noise, and the denominator."""
        a, b, initial = self.split(theta)
        right = b @ self.inputs
        right[:self.poles] += initial
        denominator = np.r_[1, a]
        return _driven(denominator, right), denominator

    def slopes(self, output, denominator=None):
        """Derivatives of the model by theta where its output is `output`, shape (p, rows)."""
        def filtered(row):
            return row if denominator is None else _driven(denominator, row)
        slopes = np.zeros((2 * self.poles + len(self.inputs), self.rows))
        self.put_past(slopes, output, denominator)
        initial = self.poles + len(self.inputs)
        # one after the other: of a long record, copies of all would take most memory
        for row, values in zip(slopes[self.poles:initial], self.inputs):
            row[:] = filtered(values)
        impulse = filtered(np.eye(1, self.rows)[0])
        for i in range(self.poles):
            slopes[initial + i, i:] = impulse[:self.rows - i]
        return slopes

    def put_past(self, slopes, output, denominator):
        """Write the derivatives by a, which are the only ones that depend on the output."""
        past = -output if denominator is None else -_driven(denominator, output)
        for i in range(self.poles):
            slopes[i, i + 1:] = past[:self.rows - i - 1]

    def least_squares(self):
        return self.instrumental(self.sensor)

    def instrumental(self, output):
        """Estimate with another model's output as instrument; least squares with the measured."""
        # a missing sample spoils the rows in which it is a regressor
        used = np.convolve(~self.used, np.ones(self.poles + 1))[:self.rows] == 0
        instruments, regressors = self.slopes(output)[:, used], self.slopes(self.sensor)[:, used]
        return solve(instruments @ regressors.T, instruments @ self.sensor[used],
                      np.sum(instruments**2, axis=1), _SINGULAR)

    def search(self, coefficients, iterations=_ITERATIONS, small=_SMALL_GAIN):
        """Refined instrumental variables from given a, b; (theta, cost)."""
        theta = np.zeros(2 * self.poles + len(self.inputs))
        theta[:len(coefficients)] = coefficients
        theta = self.stable(theta)
        # constant and initial values are linear: with the wrong ones the first step would be lost
        cost, error, output, denominator = self.evaluate(theta)
        own = self.slopes(output, denominator)[len(coefficients):, self.used]
        theta[len(coefficients):] = solve(own @ own.T, own @ error[self.used],
                                           np.sum(own**2, axis=1), _SINGULAR)
        cost, error, output, denominator = self.evaluate(theta)
        for _ in range(iterations):
            slopes = self.slopes(output, denominator)
            right, size = slopes @ error, np.einsum("ij,ij->i", slopes, slopes)
            found = self.descend(theta, solve(self.refined(slopes, output, denominator), right,
                                              size, _SINGULAR), cost)
            if found is None:
                own = slopes if self.used.all() else slopes[:, self.used]
                found = self.descend(theta, solve(own @ own.T, right, size, _SINGULAR),
                                     cost)
            if found is None:
                break
            gained = cost - found[1][0]
            theta, (cost, error, output, denominator) = found
            if gained < small * cost / self.rows:
                break
        return theta, cost

    def refined(self, slopes, output, denominator):
        """Matrix of the refined instrumental variables: instruments by measured regressors."""
        # only the past of the output differs from the slopes
        past = np.zeros((self.poles, self.rows))
        self.put_past(past, np.where(self.used, self.sensor, output), denominator)
        return np.hstack([slopes @ past.T, slopes @ slopes[self.poles:].T])

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


def _result(record, problem, orders, theta, rate, lag_s, uncertainty):
    output, denominator = problem.simulate(theta)
    residual = (problem.sensor - output)[problem.used]
    if uncertainty:
        gradient = problem.slopes(output, denominator)
        if not problem.used.all():
            gradient = gradient[:, problem.used]
        # initial motion that is over at once determines its coefficients badly, and nothing else
        felt = np.any(gradient, axis=1)
        covariance = sandwich((gradient if felt.all() else gradient[felt]).T, residual,
                              problem.used)
    else:
        covariance = np.full((len(theta),) * 2, np.nan)
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
                  (orders, theta[:count]), (), None, 0.0, np.nan, orders,
                  rate, lag_s)


def _driven(denominator, values):
    """What values become behind 1/A(z)."""
    # imported here: most identifications fit no such model
    from scipy.signal import lfilter
    return lfilter([1], denominator, values)
