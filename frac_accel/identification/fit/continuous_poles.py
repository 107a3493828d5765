"""From the poles of a sampled model to those of the continuous-time system that it samples."""

import numpy as np

METHOD = "poles mapped by s = rate * ln(z), principal branch; uncertainties to first order"


def continuous_poles(denominator, covariance, sampling_rate_hz):
    r"""Natural frequencies and damping ratios of the oscillators in a sampled model.

    Sampling maps each pole of a continuous-time system by :math:`z = e^{s/f_s}`, whatever becomes
    of its zeros, so :math:`s = f_s \ln z` gives it back if its frequency is below the Nyquist
    frequency. The coefficients themselves have no meaning in s. Standard uncertainties follow from
    :math:`\partial z/\partial a_i = -z^{n-i} / A'(z)`.

    Parameters
    ----------
    denominator : array_like, shape (n + 1,)
        1, a1 ... an, in descending powers of z.
    covariance : ndarray, shape (n, n)
        Of a1 ... an.
    sampling_rate_hz : float

    Returns
    -------
    list of dict
        ``natural_frequency_hz`` and ``damping_ratio`` of each pair of complex poles, and of the
        two poles of an overdamped model of order 2: each a dict of ``value``, ``std`` and ``unit``.
        Lowest frequency first. A pole at or left of zero in z has no counterpart and is left out.
    """
    denominator = np.asarray(denominator, float) / denominator[0]
    order = len(denominator) - 1
    z = np.roots(denominator).astype(complex)
    slope = np.polyval(np.polyder(denominator), z) if order else z
    pairs = [(z[i], z[i].conj(), slope[i], slope[i].conj())
             for i in np.flatnonzero(z.imag > 0)]
    if order == 2 and not pairs and np.all(z.real > 0) and z[0] != z[1]:
        pairs = [(*z, *slope)]
    powers = np.arange(order - 1, -1, -1)
    result = []
    for first, second, first_slope, second_slope in pairs:
        s = sampling_rate_hz * np.log([first, second])
        by_a = -sampling_rate_hz * np.stack([first**(powers - 1.0) / first_slope,
                                             second**(powers - 1.0) / second_slope])
        # s1 s2 = omega^2 and s1 + s2 = -2 zeta omega
        omega = np.sqrt((s[0] * s[1]).real)
        omega_by_a = (s[0] * by_a[1] + s[1] * by_a[0]).real / (2 * omega)
        ratio = -s.sum().real / (2 * omega)
        ratio_by_a = -by_a.sum(axis=0).real / (2 * omega) - ratio * omega_by_a / omega
        result.append({
            "natural_frequency_hz": _entry(omega, omega_by_a, covariance, 2 * np.pi, "Hz"),
            "damping_ratio": _entry(ratio, ratio_by_a, covariance, 1.0, "1")})
    return sorted(result, key=lambda pair: pair["natural_frequency_hz"]["value"])


def _entry(value, by_a, covariance, divisor, unit):
    std = np.sqrt(max(by_a @ covariance @ by_a, 0.0))
    return {"value": float(value / divisor), "std": float(std / divisor), "unit": unit}
