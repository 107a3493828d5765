"""What the pages say about signals, in words, and show of them over time."""


def sentence(words):
    """Words with a capital letter and a full stop."""
    return words[0].upper() + words[1:].rstrip(".") + "."


def over_time(section, seen, drawn, most, words):
    """Add the figures of some evidence over time: the whole record and, where there is one, a part.

    Parameters
    ----------
    section : Section
    seen : Evidence
    drawn : callable
        Figure of one of its views.
    most : int
        Points of a signal that are kept of the whole record.
    words : str
        What is drawn.
    """
    words += f". Thinned from {seen.samples} samples to the extremes of {most // 2} stretches." \
        if seen.samples > most else "."
    section.figure(drawn(seen.signals["whole"]), words)
    if seen.signals.get("close_up"):
        section.figure(drawn(seen.signals["close_up"]),
                       f"The {seen.close_up_samples} samples with the strongest output.")
