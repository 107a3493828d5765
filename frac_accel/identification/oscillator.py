"""Classical seismic sensor from a measured pair, by output error in the time domain."""

import dataclasses

import numpy as np
from scipy.optimize import least_squares

from ..errors import IdentificationError
from ..simulation import Convolution

PARAMETERS = ("sensitivity", "natural_frequency_hz", "damping_ratio", "delay_s", "offset")
# Samples at both ends that the band-limited simulation cannot know, besides the unknown start.
_EDGE = 32
_START_FREQUENCIES = 16
_STARTS = 3
# Share of the output's power, times the number of independent frequencies, that the best of all
# resonances and delays still explains of an unrelated signal.
_CHANCE = 10
_START_DAMPINGS = (0.03, 0.15, 0.7)


@dataclasses.dataclass(frozen=True)
class OscillatorFit:
    """Result of `fit_oscillator`.

    Attributes
    ----------
    values : ndarray, shape (5,)
        In the order of `PARAMETERS`.
    covariance : ndarray, shape (5, 5)
        Allows for a residual that is not white.
    residual : ndarray, shape (n,)
        Measured less simulated [output units]; NaN where not judged.
    """

    values: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray

    @property
    def std(self):
        """Standard uncertainties, in the order of `PARAMETERS`."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0))

    @property
    def rmse(self):
        """RMS of the residual [output units]."""
        return float(np.sqrt(np.nanmean(self.residual**2)))


def fit_oscillator(reference, sensor, sampling_rate_hz, valid=None, lag_s=0.0):
    r"""Sensitivity, natural frequency, damping ratio, delay and offset of a classical sensor.

    Minimises the sum of the squared differences between the measured output and that simulated
    from the reference,

    .. math:: y(t) = S \, (g_{f_0, \zeta} * a)(t - \tau) + b + c_1 e_1(t) + c_2 e_2(t)

    (output error, L. Ljung, *System Identification*, 2nd ed., section 4.2), where :math:`e_1, e_2`
    are the sensor's free decays, which stand for its unknown motion before the record. Sensitivity,
    offset and the free decays enter linearly and are eliminated in each step (variable projection,
    G. Golub, V. Pereyra, *Inverse Problems* 19 (2003) R1).

    Parameters
    ----------
    reference, sensor : ndarray, shape (n,)
    sampling_rate_hz : float
    valid : ndarray of bool, shape (n,), optional
        Samples that count.
    lag_s : float
        Time by which the sensor's instants are later than the reference's.

    Returns
    -------
    OscillatorFit

    Raises
    ------
    IdentificationError
        If no parameters explain the data better than nothing at all.

    Notes
    -----
    The covariance is :math:`(J^T J)^{-1} J^T \Gamma J (J^T J)^{-1}`, with the residual's
    autocovariance :math:`\Gamma` from its smoothed spectrum, so that it holds for a residual that
    is not white (Ljung, equation (9.42)).
    """
    problem = _Problem(reference, sensor, sampling_rate_hz, valid, lag_s)
    best = problem.refine(problem.coarse())
    return problem.result(best)


class _Problem:
    """The nonlinear parameters are log f0, log zeta and the delay in samples."""

    def __init__(self, reference, sensor, rate, valid, lag_s):
        self.rate, self.lag_s = rate, lag_s
        # the first value is taken as steady before the record: its response is a constant
        self.level = reference[0]
        self.reference, self.sensor = reference - self.level, sensor
        self.n = len(sensor)
        self.time = np.arange(self.n) / rate
        self.simulate = Convolution(self.reference, rate, 2 * _EDGE / rate).response
        self._last = None
        self.used = np.ones(self.n, bool) if valid is None else valid.copy()
        self.used[:min(_EDGE, self.n // 8)] = False
        self.used[-min(_EDGE, self.n // 8):] = False

    def transfer_function(self, nonlinear):
        omega, zeta = 2 * np.pi * np.exp(nonlinear[0]), np.exp(nonlinear[1])
        delay = nonlinear[2] / self.rate - self.lag_s

        def response(s):
            u = s / omega
            return np.exp(-s * delay) / (u * u + 2 * zeta * u + 1)
        return response

    def derivatives(self, nonlinear):
        """Transfer functions of the derivatives by the nonlinear parameters, S = 1."""
        base = self.transfer_function(nonlinear)
        omega, zeta = 2 * np.pi * np.exp(nonlinear[0]), np.exp(nonlinear[1])

        def by_frequency(s):
            u = s / omega
            return base(s) * (2 * u * u + 2 * zeta * u) / (u * u + 2 * zeta * u + 1)

        def by_damping(s):
            u = s / omega
            return -base(s) * 2 * zeta * u / (u * u + 2 * zeta * u + 1)

        return by_frequency, by_damping, lambda s: -s / self.rate * base(s)

    def linear_columns(self, nonlinear):
        omega, zeta = 2 * np.pi * np.exp(nonlinear[0]), np.exp(nonlinear[1])
        columns = [self.simulate(self.transfer_function(nonlinear)), np.ones(self.n)]
        if zeta < 1:
            decay = np.exp(-zeta * omega * self.time)
            swing = omega * np.sqrt(1 - zeta**2) * self.time
            columns += [decay * np.cos(swing), decay * np.sin(swing)]
        else:
            spread = np.sqrt(zeta**2 - 1)
            columns += [np.exp(-omega * (zeta - spread) * self.time),
                        np.exp(-omega * (zeta + spread) * self.time)]
        # a decay that is over before the first used sample is no column
        return [c for c in columns if np.max(np.abs(c[self.used])) > 1e-9]

    def project(self, nonlinear):
        """Residual, linear coefficients and the columns that they multiply."""
        if self._last is not None and np.array_equal(self._last[0], nonlinear):
            return self._last[1]
        columns = np.stack([c[self.used] for c in self.linear_columns(nonlinear)], axis=1)
        scale = np.linalg.norm(columns, axis=0)
        coefficients = np.linalg.lstsq(columns / scale, self.sensor[self.used], rcond=1e-10)[0]
        coefficients = coefficients / scale
        residual = self.sensor[self.used] - columns @ coefficients
        self._last = nonlinear.copy(), (residual, coefficients, columns)
        return self._last[1]

    def slopes(self, nonlinear, sensitivity):
        """Derivatives of the output by the nonlinear parameters, shape (used samples, 3)."""
        return np.stack([sensitivity * self.simulate(f)[self.used]
                         for f in self.derivatives(nonlinear)], axis=1)

    def coarse(self):
        """Starting points, best first: a grid of resonances, each with its best whole delay."""
        length = 2 * self.n
        frequency = np.fft.rfftfreq(length, 1 / self.rate)
        s = 2j * np.pi * frequency
        x = np.fft.rfft(self.reference - self.reference.mean(), length)
        y = np.fft.rfft(self.sensor - self.sensor.mean(), length)
        power = np.abs(x)**2
        shared = power * np.abs(y)**2
        # how many independent frequencies the two have in common; the zero padding doubles them
        self.independent = np.sum(shared)**2 / np.sum(shared**2) / 2
        span = frequency[(frequency > 0) & (power > 1e-6 * power.max())]
        lowest, highest = span[0], span[-1]
        starts = []
        for f0 in np.geomspace(max(lowest * 2, highest / 100), highest * 3, _START_FREQUENCIES):
            for zeta in _START_DAMPINGS:
                z = self.transfer_function((np.log(f0), np.log(zeta), 0.0))(s) * x
                # correlation at each delay: the best gain is it over the simulated power
                shared = np.fft.irfft(np.conj(z) * y, length)
                lags = np.r_[0:self.n // 4, -(self.n // 4):0]
                lag = lags[np.argmax(np.abs(shared[lags]))]
                explained = shared[lag]**2 / np.sum(np.abs(z)**2)
                starts.append((-explained, (np.log(f0), np.log(zeta), float(lag))))
        return [start for _, start in sorted(starts)]

    def bounds(self):
        return ([np.log(self.rate / self.n), np.log(1e-4), -self.n / 4],
                [np.log(50 * self.rate), np.log(20), self.n / 4])

    def refine(self, starts):
        """Best of the most promising starting points in the time domain."""
        size = np.std(self.sensor[self.used])
        fits = []
        for start in starts[:_STARTS]:
            def residual(nonlinear):
                return self.project(nonlinear)[0] / size

            def jacobian(nonlinear):
                _, coefficients, columns = self.project(nonlinear)
                slopes = self.slopes(nonlinear, coefficients[0])
                basis = np.linalg.qr(columns)[0]
                # Kaufman's form: the part of the slopes that the linear columns cannot take up
                return -(slopes - basis @ (basis.T @ slopes)) / size

            fit = least_squares(residual, start, jacobian, x_scale=[0.1, 0.3, 0.3],
                                bounds=self.bounds(), max_nfev=40, xtol=1e-10, ftol=1e-10)
            fits.append((fit.cost, tuple(fit.x)))
        best = min(fits)
        explained = 1 - 2 * best[0] / np.sum(self.used)
        if explained < min(_CHANCE / self.independent, 0.5):
            raise IdentificationError(
                "the sensor's output has nothing to do with the reference: the best model explains "
                f"{max(explained, 0):.2%} of its power, which chance alone can do")
        return np.array(best[1])

    def result(self, nonlinear):
        residual, coefficients, columns = self.project(nonlinear)
        f0, zeta = np.exp(nonlinear[:2])
        # by f0 and zeta themselves, and the delay in seconds
        slopes = self.slopes(nonlinear, coefficients[0]) / np.array([f0, zeta, 1 / self.rate])
        jacobian = np.concatenate([columns[:, :1], slopes, columns[:, 1:]], axis=1)
        covariance = sandwich(jacobian, residual, self.used)[:5, :5]
        full = np.full(self.n, np.nan)
        full[self.used] = residual
        offset = coefficients[1] - coefficients[0] * self.level
        values = np.array([coefficients[0], f0, zeta, nonlinear[2] / self.rate, offset])
        return OscillatorFit(values, covariance, full)


def sandwich(jacobian, residual, used):
    r"""Covariance of least-squares parameters for a residual that is not white.

    Parameters
    ----------
    jacobian : ndarray, shape (m, p)
    residual : ndarray, shape (m,)
    used : ndarray of bool, shape (n,)
        Where the m rows stand in the record.

    Returns
    -------
    ndarray, shape (p, p)
    """
    n = len(used)
    length = 2 * n
    full = np.zeros((n, jacobian.shape[1] + 1))
    full[used] = np.concatenate([jacobian, residual[:, None]], axis=1)
    spectra = np.fft.rfft(full, length, axis=0)
    power = np.abs(spectra[:, -1])**2 / len(residual)
    width = max(5, int(np.sqrt(len(power))) // 2 * 2 + 1)
    smooth = np.convolve(np.pad(power, width // 2, mode="reflect"), np.ones(width) / width, "valid")
    columns = spectra[:, :-1]
    twice = np.full(len(power), 2.0)
    twice[[0, -1]] = 1.0
    meat = np.real((np.conj(columns) * (twice * smooth)[:, None]).T @ columns) / length
    scale = np.linalg.norm(jacobian, axis=0)
    values, vectors = np.linalg.eigh((jacobian / scale).T @ (jacobian / scale))
    # a direction that the data leave open must come out as uncertain, not as certain
    bread = (vectors / np.maximum(values, 1e-15 * values[-1])) @ vectors.T / np.outer(scale, scale)
    freedom = len(residual) / max(len(residual) - jacobian.shape[1], 1)
    return freedom * bread @ meat @ bread
