"""Uncertainty of least-squares parameters when the residual is not white."""

import numpy as np
from scipy.fft import next_fast_len, rfft
from scipy.ndimage import uniform_filter1d

# Standard uncertainties from which on a parameter differs from another value.
SIGNIFICANT = 3.0
# Padding of the spectra, in roots of the record.
_REACH = 12
# Share of a band's noise that a residual shows at least.
_LEAST = 0.05
# Widths of the smoothing in which flicker noise is sought, steps of its fit, and log-likelihood
# that it must gain: chance does that in less than one record of a thousand.
_FLICKER_REACH, _STEPS, _FLICKER_GAIN = 2, 8, 6.0
# Share of a residual's power that must be no white noise for it to count as the model's error.
_BEYOND = 0.2
# Blocks of a record whose scatter is compared: each is longer than what a residual remembers.
_BLOCKS = 40
# Share of the blocks that are quiet.
_QUIET = 0.05
# Lines of the spectra that are multiplied at a time.
_BLOCK = 1 << 15


def sandwich(jacobian, residual, used, room=None):
    r"""Covariance :math:`(J^T J)^{-1} J^T \Gamma J (J^T J)^{-1}`.

    The residual's autocovariance :math:`\Gamma` comes from its smoothed spectrum (L. Ljung, *System
    Identification*, 2nd ed., equation (9.42)), over what the fit to white noise would leave of it:
    slow columns take most of the lowest frequencies out of the residual.

    Parameters
    ----------
    jacobian : ndarray, shape (m, p)
    residual : ndarray, shape (m,)
    used : ndarray of bool, shape (n,)
        Where the m rows stand in the record.
    room : ndarray of float, shape (p, spectrum_room(n)), optional
        Memory that is overwritten, also where the jacobian lies in it, each column in one row.

    Returns
    -------
    ndarray, shape (p, p)
        Huge, not small, for what the data leave open.
    """
    gram = jacobian.T @ jacobian
    scale = np.sqrt(np.diag(gram))
    length = _padded(len(used))
    spectra = _spectra(jacobian.T, scale, used, length, room)
    power = np.square(np.abs(_spectra(residual[None], np.ones(1), used, length)[0]))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    root = vectors / np.sqrt(np.maximum(values, 1e-14 * values[-1]))
    # what a fit to white noise leaves of each line
    left = np.empty(len(power))
    # by blocks: of a long record, copies of all spectra would take most memory
    blocks = [slice(start, start + _BLOCK) for start in range(0, len(power), _BLOCK)]
    for lines in blocks:
        # real and imaginary parts side by side: the product is one of real numbers
        part = spectra[:, lines].view(float)
        part[:] = fitted = root.T @ part
        left[lines] = len(residual) - np.einsum("pl,pl->l", fitted, fitted).reshape(-1, 2).sum(1)
    smooth = _smoothed(power, left, max(5, int(len(power) / np.sqrt(len(used)))),
                       _LEAST * len(residual))
    twice = np.full(len(power), 2.0)
    twice[0] = 1.0
    if length % 2 == 0:
        twice[-1] = 1.0
    middle = np.zeros((len(scale), len(scale)))
    for lines in blocks:
        weighted = (spectra[:, lines] * np.sqrt(twice[lines] * smooth[lines])).view(float)
        middle += weighted @ weighted.T
    # as a square, so that rounding makes no variance negative
    strengths, directions = np.linalg.eigh(middle / length)
    root = root @ (directions * np.sqrt(np.maximum(strengths, 0))) / scale[:, None]
    return root @ root.T


def _smoothed(power, left, width, least):
    """Spectrum of the noise from a residual's, over what the fit leaves of each line.

    Smoothed, and at the lowest frequencies with what flicker noise adds: slow columns see most of
    that, and it falls within a few lines.
    """
    wide, fitted = (uniform_filter1d(v, width, mode="reflect") for v in (power, left))
    smooth = wide / np.maximum(fitted, least)
    line = np.arange(min(_FLICKER_REACH * width, len(power)))
    flicker = _flicker(power[line], np.maximum(left[line], least), smooth[line[-1]])
    smooth[line] = np.maximum(smooth[line], flicker)
    return smooth


def _flicker(power, left, level):
    r"""Spectrum a + b/k or a + b/k² of the line k from a residual's lowest lines; 0 where b is not
    significant.

    A line scatters as much as it has on average, so that each step of the fit weighs it by that
    (maximum likelihood of exponentially distributed lines: P. Whittle, *Ark. Mat.* 2 (1953) 423).
    The first line, below which a record has none, stands for half a line.
    """
    line = np.maximum(np.arange(len(power)), 0.5)
    best, found = np.inf, np.zeros(len(power))
    for exponent in (0, 1, 2):
        laws = np.stack([np.ones(len(line)), line**-exponent], axis=1)[:, :1 + (exponent > 0)]
        expected = np.full(len(line), level)
        for _ in range(_STEPS):
            weights = 1 / (expected * left)
            rows = laws * (left * weights)[:, None]
            inverse = np.linalg.pinv(rows.T @ rows)
            size = np.maximum(inverse @ (rows.T @ (power * weights)), 0.0)
            expected = np.maximum(laws @ size, _LEAST * level)
        cost = np.sum(np.log(expected) + power / (expected * left))
        if exponent == 0:
            best = cost - _FLICKER_GAIN
        elif cost < best:
            best, found = cost, expected
    return found


def spectrum_room(count):
    """Numbers that `sandwich` needs for the spectrum of a column of a record of so many samples."""
    return 2 * (_padded(count) // 2 + 1)


def _padded(count):
    """Samples of a spectrum: smoothed, it reaches over lags of a few times the record's root."""
    return next_fast_len(count + int(_REACH * np.sqrt(count)), real=True)


def _spectra(rows, scale, used, length, room=None):
    """Spectra of rows over their sizes, put where `used` is, shape (p, length // 2 + 1)."""
    first, last = np.flatnonzero(used)[[0, -1]]
    spectra = np.empty((len(rows), length // 2 + 1), complex) if room is None \
        else room.view(complex)
    for spectrum, row, size in zip(spectra, rows, scale):
        row = row / size
        # where the rows begin turns all spectra alike; only gaps need their place
        if last + 1 - first > len(row):
            placed = np.zeros(len(used))
            placed[used] = row
            row = placed
        spectrum[:] = rfft(row, length)
    return spectra


def by_blocks(jacobian, residual):
    r"""Covariance with the sums of :math:`J^T r` over blocks of the rows for its middle part.

    It presumes nothing of how the residual goes with the motion: where it is larger, or of the same
    sign, wherever a parameter shows most, as what a model lacks is, the stationary noise of
    `sandwich` finds intervals that are too narrow (K.-Y. Liang, S. L. Zeger, *Biometrika* 73 (1986)
    13-22, with blocks for their clusters).

    Parameters
    ----------
    jacobian : ndarray, shape (m, p)
    residual : ndarray, shape (m,)

    Returns
    -------
    ndarray, shape (p, p)
    """
    scale = np.linalg.norm(jacobian, axis=0)
    scaled = jacobian / scale
    count = min(_BLOCKS, len(residual))
    edges = np.linspace(0, len(residual), count + 1).astype(int)[:-1]
    sums = np.add.reduceat(scaled * residual[:, None], edges)
    inverse = np.linalg.pinv(scaled.T @ scaled, rcond=1e-14, hermitian=True) / scale[:, None]
    return inverse @ (sums.T @ sums) @ inverse.T * count / max(count - 1, 1)


def beyond_noise(nrmse, noise_nrmse):
    """What a model leaves beyond white noise; all relative to the output's standard deviation.

    0 where it is no more than the estimate of the noise is uncertain by.
    """
    beyond = nrmse**2 - noise_nrmse**2
    return float(np.sqrt(beyond)) if beyond > _BEYOND * nrmse**2 else 0.0


def noise_floor(residual):
    """White part of a residual, or its RMS where the record is quietest, whichever is larger.

    Noise of low frequency shows there, when no motion brings out what the model gets wrong.
    """
    blocks = np.array_split(np.nan_to_num(residual), _BLOCKS)
    quiet = np.quantile([np.sqrt(np.mean(block**2)) for block in blocks if len(block)], _QUIET)
    return max(white_noise(residual), float(quiet))


def white_noise(residual):
    """White part of the residual: what is left above half the Nyquist frequency, spread evenly.

    Below, the residual also holds what the model gets wrong, which is not noise.
    """
    clean = np.nan_to_num(residual)
    taper = np.hanning(len(clean))
    power = np.abs(rfft(clean * taper))**2
    window = taper @ taper
    # the median of a chi-squared of two degrees is ln 2 of its mean
    return float(np.sqrt(np.median(power[len(power) // 2:]) / np.log(2) / window))
