"""Filters of a whole record, which may look ahead."""


def filtered(values, sampling_rate_hz, resolution_hz, share):
    """Values of which a share is left at each frequency.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Their mean stays as it is.
    sampling_rate_hz : float
    resolution_hz : float
        What the share may change within [Hz].
    share : callable
        From frequencies [Hz] from 0 on, shape (m,), to what is left there, real or complex.

    Returns
    -------
    ndarray, shape (n,)
    """
    from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
    # it begins before the motion, by as much as its frequencies are apart
    length = next_fast_len(len(values) + int(2 * sampling_rate_hz / resolution_hz), real=True)
    level = values.mean()
    left = share(rfftfreq(length, 1 / sampling_rate_hz))
    return level + irfft(left * rfft(values - level, length), length)[:len(values)]
