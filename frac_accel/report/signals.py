"""What the pages say about signals: stretches, segments, words."""

from scipy.signal import welch

from . import figures

# Periods of the reference's mean frequency in a close-up.
_PERIODS = 25


def sentence(words):
    """Words with a capital letter and a full stop."""
    return words[0].upper() + words[1:].rstrip(".") + "."


def close_up(reference):
    """Number of samples in which single oscillations can be seen."""
    frequency, power = welch(reference, nperseg=segment(len(reference)))
    return int(_PERIODS * power.sum() / (power @ frequency))


def segment(samples):
    """Length of the segments of a spectrum: enough of them to average."""
    return min(samples, max(256, min(samples // 8, 8192)))


def thinned(samples):
    """End of the caption of a figure over time."""
    most = figures.MOST_POINTS
    return (f". Thinned from {samples} samples to the extremes of {most // 2} stretches."
            if samples > most else ".")
