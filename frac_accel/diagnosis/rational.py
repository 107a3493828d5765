"""Rational functions of frequency, fitted to a response."""

import numpy as np

# Passes, which converge within a few.
_PASSES = 8
# Damping of the poles from which a fit starts, over their frequency.
_DAMPING = 0.05
# Singular values of scaled columns, over the largest, that are nothing.
_NOTHING = 1e-11
# Shares of a pole's size below which its imaginary part is none.
_REAL = 1e-9


def fit_rational(s, response, weight, order, least_damping, sizes):
    r"""Poles and coefficients of :math:`d + \sum_i c_i / (s - p_i)`, stable and real.

    Vector fitting (B. Gustavsen, A. Semlyen, *IEEE Trans. Power Delivery* 14 (1999) 1052-1061):
    the poles are those zeros of :math:`\sigma = 1 + \sum_i \tilde c_i / (s - p_i)` with which
    :math:`\sigma H` is a rational function with the old poles. Unstable ones are mirrored.

    Parameters
    ----------
    s : ndarray of complex, shape (n,)
        On the imaginary axis, without 0 [rad/s or any other unit].
    response : ndarray of complex, shape (n,)
    weight : ndarray, shape (n,)
    order : int
        Number of poles.
    least_damping : float
        Real parts are at most minus this, in units of `s`.
    sizes : (float, float)
        Least and largest size of a pole, in units of `s`.

    Returns
    -------
    numerator, denominator : ndarray, shape (order + 1,)
        Of polynomials in s, the highest power first.
    """
    poles = _starts(np.abs(s).min(), min(np.abs(s).max(), sizes[1]), order)
    for _ in range(_PASSES):
        parts = _parts(s, poles)
        every = np.c_[parts, np.ones(len(s)), -response[:, None] * parts]
        found = real_solution(every * weight[:, None], response * weight)
        poles = _in_order(_within(_zeros(poles, found[order + 1:]), least_damping, sizes))
    parts = np.c_[_parts(s, poles), np.ones(len(s))]
    return _polynomials(poles, real_solution(parts * weight[:, None], response * weight))


def real_solution(matrix, right):
    """Real solution of complex equations by least squares."""
    matrix, right = np.r_[matrix.real, matrix.imag], np.r_[right.real, right.imag]
    size = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    return np.linalg.lstsq(matrix / size, right, rcond=_NOTHING)[0] / size


def _starts(lowest, highest, order):
    """Lightly damped pairs all over the band, and one real pole of an odd order."""
    wave = np.linspace(lowest, highest, max(order // 2, 1) + 1)[1:] if order > 1 else np.empty(0)
    pairs = [wave * (-_DAMPING + 1j), wave * (-_DAMPING - 1j)]
    alone = [-np.sqrt(lowest * highest)] if order % 2 else []
    return np.r_[alone, np.stack(pairs, axis=1).ravel()].astype(complex)


def _within(poles, least_damping, sizes):
    """Stable poles, none slower or faster than what was seen: a level that only a slow one has is
    reached long after the record has begun."""
    size = np.maximum(np.abs(poles), 1e-300)
    poles = poles * np.clip(size, *sizes) / size
    return -np.maximum(np.abs(poles.real), least_damping) + 1j * poles.imag


def _in_order(poles):
    """Real poles, then pairs, the positive imaginary part first."""
    real = poles[np.abs(poles.imag) <= _REAL * np.abs(poles)].real
    upper = poles[poles.imag > _REAL * np.abs(poles)]
    return np.r_[real, np.stack([upper, upper.conj()], axis=1).ravel()]


def _columns(poles):
    """Place and whether it is the first of a pair, of each column but the second ones of pairs."""
    place = 0
    while place < len(poles):
        pair = poles[place].imag != 0
        yield place, pair
        place += 1 + pair


def _parts(s, poles):
    """Partial fractions with real coefficients, shape (n, order)."""
    parts = 1 / (s[:, None] - poles)
    for place, pair in _columns(poles):
        if pair:
            one, other = parts[:, place].copy(), parts[:, place + 1].copy()
            parts[:, place], parts[:, place + 1] = one + other, 1j * (one - other)
    return parts


def _zeros(poles, coefficients):
    """Zeros of 1 + the sum of partial fractions: eigenvalues of A - b c (Appendix B there)."""
    matrix, inputs = np.zeros((len(poles), len(poles))), np.ones(len(poles))
    for place, pair in _columns(poles):
        pole = poles[place]
        if pair:
            matrix[place:place + 2, place:place + 2] = [[pole.real, pole.imag],
                                                        [-pole.imag, pole.real]]
            inputs[place:place + 2] = 2.0, 0.0
        else:
            matrix[place, place] = pole.real
    return np.linalg.eigvals(matrix - np.outer(inputs, coefficients)).astype(complex)


def _polynomials(poles, coefficients):
    """Numerator and denominator of partial fractions and a constant."""
    denominator = np.real(np.poly(poles))
    numerator = coefficients[-1] * denominator
    for place, pair in _columns(poles):
        others = np.delete(poles, [place, place + 1] if pair else place)
        if pair:
            # c1 (1 / (s - p) + 1 / (s - p*)) + c2 i (1 / (s - p) - 1 / (s - p*))
            pole, (first, second) = poles[place], coefficients[place:place + 2]
            part = [2 * first, -2 * (first * pole.real + second * pole.imag)]
            added = np.polymul(part, np.atleast_1d(np.real(np.poly(others))))
        else:
            added = coefficients[place] * np.atleast_1d(np.real(np.poly(others)))
        numerator[len(numerator) - len(added):] += added
    return numerator, denominator
