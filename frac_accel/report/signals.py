"""What the pages say about signals, in words."""


def sentence(words):
    """Words with a capital letter and a full stop."""
    return words[0].upper() + words[1:].rstrip(".") + "."


def thinned(samples, most):
    """End of the caption of a figure over time, of which at most so many points are kept."""
    return (f". Thinned from {samples} samples to the extremes of {most // 2} stretches."
            if samples > most else ".")
