"""The verdict and its words."""

from ..budget import WORDS
from ..model.effects.base import STAMPS
from ..shown import listed, several

# Share of the output's RMS that may be left without noise being established, and factor by which an
# error may exceed noise that is.
_LITTLE = 0.05
AS_NOISE = 1.2
# Share of the excess power that rounds to nothing.
_NOTHING = 0.005
# Share of the residual's power that may be no noise in a record that counts as explained.
_MOSTLY_NOISE = 0.3
# Least share of the output that is given as a number.
_SHOWN = 1e-4
# Share of an error by which the reference's own noise is worth a word.
_HIDDEN = 0.1
# Share of the sensor's output (RMS) beyond the frequencies that are compared that is worth a word.
_BEYOND = 0.01
# Sampling intervals by which no sensor is earlier than what moves it.
_EARLY = 2.0


def is_accounted(rmse, spread, noise):
    """Whether an error is small beside the output's spread, or no larger than established noise."""
    return rmse <= _LITTLE * spread or (noise.rms is not None and rmse <= AS_NOISE * noise.rms)


def hides_much(beyond):
    """Whether a sensor has more than a little beyond the frequencies that are compared."""
    return beyond is not None and beyond.share > _LITTLE


def verdict_of(findings, suspects, complete, share, fraction, accounted, strange):
    if not findings and not suspects and share == 0:
        if strange:
            return "unexplained"
        return "consistent" if accounted else "undecided"
    nothing = fraction < _NOTHING
    if findings and (nothing or complete and share <= _MOSTLY_NOISE):
        return "explained" if accounted else "partly_explained" if strange else "undecided"
    # when samples were taken, or that some are lost, explains nothing of what is left
    if any(finding.effect.stage != STAMPS for finding in findings):
        return "partly_explained"
    return "unexplained"


def reason_of(verdict, nrmse, noise, accounted, strange, grows, beyond=None, unsure=False):
    """Words for a verdict; `unsure`: what explains the record has no name."""
    if verdict == "unexplained" and accounted and unsure and not strange:
        return ("the model in use is wrong, and nothing that would explain it is sure enough for a "
                f"name; {_percent(nrmse)} of the output is left with it" + beyond_words(beyond))
    if verdict == "undecided" and grows:
        return (f"{nrmse:.1%} of the output is unaccounted for; it comes and goes with the motion, "
                "and nothing predicts it: noise that grows with the motion, or an unknown cause; "
                "repeat the same motion: what comes again is no noise" + beyond_words(beyond))
    if verdict == "undecided" and accounted and hides_much(beyond):
        return (f"the model explains the record up to {_percent(nrmse)} of the output where it is "
                "compared, but there only; record the reference as fast as the sensor"
                + beyond_words(beyond))
    return _reason(verdict, nrmse, noise, accounted, strange) + beyond_words(beyond)


def beyond_words(beyond):
    """Words for what the sensor has beyond the frequencies that are compared."""
    return f"; {beyond.words}" if beyond is not None and beyond.share > _BEYOND else ""


def _reason(verdict, nrmse, noise, accounted, strange):
    shown = {"rest": "down to the noise that it shows at rest",
             "covariance": "down to the noise that its messages state",
             "periods": "down to the noise by which its repeated periods differ",
             "stated": "down to the noise that was stated",
             "second_sensor": "down to the noise that a second sensor does not share"}
    to = shown[noise.by] if noise.rms is not None and nrmse > _LITTLE and accounted \
        else f"up to {_percent(nrmse)} of the output"
    left = f"; {_percent(nrmse)} of the output is left"
    parts = ", ".join(f"{share:.0%} {part} ({WORDS[part]})" for share, part in strange[:2])
    if strange:
        left += f", of which {parts}"
    return {"consistent": f"the model explains the record {to}"
                          + (f"; of what is left, {parts}" if strange else ""),
            "explained": f"the named causes explain the record {to}"
                         + (f"; of what is left, {parts}" if strange else ""),
            "partly_explained": "the named causes leave a part unexplained" + left,
            "unexplained": "no known cause explains what the model gets wrong" + left,
            "undecided": f"{nrmse:.1%} of the output is unaccounted for; {_unknown(noise)}; "
                         "record the sensor at rest too, or repeat the same motion, or state its "
                         "noise (--noise-std)"}[verdict]


def _percent(share):
    return f"{share:.2%}" if share >= _SHOWN else f"less than {_SHOWN:.2%}"


def set_aside(aside, drowned, valid):
    """Words for the samples that were not judged."""
    return "".join(
        "; " + several(rows.sum(), "sample does not count", "samples do not count")
        + f" ({rows.sum() / valid.sum():.2%}): {why} there"
        for rows, why in ((aside, "a signal stood still or had spikes"),
                          (drowned, "a short and strong error drowns all else")) if rows.any())


def description_words(described, unnamed, kept, left):
    """Words for what the extended model holds beside named causes: fitted curves, causes that
    were identified with it, and those that are only suspected, with what they leave."""
    parts = []
    if described:
        parts.append(f"has {listed(described)}, which " + (
            "describes a part of it and names nothing" if len(described) == 1 else
            "describe a part of it and name nothing"))
    if unnamed:
        parts.append(f"keeps {listed(unnamed)} without a name")
    if kept:
        describe, are = ("describes", "is") if len(kept) == 1 else ("describe", "are")
        parts.append(f"keeps {listed(kept)}, which {describe} a part of it and {are} not named")
    if not parts:
        return ""
    return "; the extended model " + "; it ".join(parts) + (
        f": {_percent(left)} of the output is left with that model" if described or kept else "")


def hint_words(share):
    """Words for the share of what is left that follows the motion, in a consistent record."""
    return f"; {share:.0%} of the power of what is left follows the motion" if share else ""


def hidden_words(own, error):
    """Words for what the reference's own noise (RMS) makes of an error (RMS)."""
    return (f"; {min(own / error, 1.0)**2:.0%} of that power is what the reference's own noise "
            "hides") if own > _HIDDEN * error else ""


def ahead_words(lead_s, rate):
    """Words for a model that answers so long before the reference moves."""
    return (f"; it answers {lead_s:.2g} s before the reference moves, which no sensor does: the "
            "reference is late, or the sensor is not moved by what the reference shows, as at "
            "another place of a structure") if lead_s > _EARLY / rate else ""


def _unknown(noise):
    if noise.rms is None:
        return "nothing in the record shows that it is noise"
    return f"the noise that is established ({noise.rms:.3g} RMS, by {noise.by}) is less than that"


def gain_words(cause, g, margin, instead):
    words = [f"held-out error {g.before:.4g} without it, {g.after:.4g} with it "
             f"({g.reduction:.1%} less, 95 % interval {g.ci95[0]:.1%} to {g.ci95[1]:.1%})"]
    if instead:
        words.append(f"nearest rival: {' with '.join(instead)}, fits worse by {margin:.2g} σ²")
    return words
