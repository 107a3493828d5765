"""What the state of a running correction means: a level, and a sentence that says what to do."""

import dataclasses

from ..model import AXES
from ..shown import several
from .live_metrics import Findings
from .monitors import NOT_CONNECTED
from .timing import RATE_SAMPLES

OK, WARN, ERROR = range(3)

# A topic is silent after this long without a message [s].
SILENT_AFTER_S = 2.0
# Shorter times [s] without a message say nothing.
_SOME_S = 0.5
# The stamps' rate may be off the stated one by this share.
RATE_SHARE = 0.05
_BUSY = 0.9
_DROPPED = {
    "duplicates": "had the same stamp as the one before",
    "stamps_back": "had a stamp before the one before",
    "early": "came too early for the sampling rate",
    "not_finite": "had a value that is not finite",
    "implausible": "had a value that cannot be true",
    "other_publisher": "came from another publisher",
    "without_rate": "were too far apart to tell the sampling rate: most samples are lost",
}
_SHORT_SHOCKS = " (shocks of one or two samples look the same: state plausible_range to keep them)"
_FAULTS = {"dead": "says nothing but zero", "stuck": "is stuck at one value",
           "saturated": "is at the end of its range", "held": "repeats its samples",
           "too fast": "changes faster than stated"}


@dataclasses.dataclass(frozen=True)
class Publisher:
    """A publisher on the raw topic.

    Attributes
    ----------
    node : str
    refusal : str
        Why nothing can be received from it; empty if it can.
    """

    node: str
    refusal: str = ""


@dataclasses.dataclass(frozen=True)
class Situation:
    """What is known of one topic's correction over the last period.

    Attributes
    ----------
    topic : str
        The raw topic.
    model_file : str
        Empty without a model.
    failure : str
        Why there is no filter, if its design has failed.
    designing : bool
        Whether a filter is being designed and nothing can be corrected before it is there.
    publishers : tuple of Publisher
    refused_subscribers : tuple of str
        Who asks for the corrected topic in vain, and why.
    seconds_since_message : float or None
        None if there never was one.
    stated_rate_hz : float
        Parameter ``sample_rate_hz``; 0: to be estimated.
    sampling_rate_hz : float or None
        Rate in use.
    batch_size : float
        How many samples share a stamp, where they do; else 0.
    warm_up_samples : int or None
        Samples that the filter needs before its first output.
    counters, changes : dict of str to int
        Counters, and what they have grown by in the last period. Besides those of `Stream`:
        ``malformed``, ``lost``, ``late``, ``without_filter``.
    stale_s : float or None
        Time since the last output, where there ever was one.
    stale_after_s : float
        From when on that is too long.
    faults : tuple of str
        What is wrong with each axis, as `Stream.faults` says it.
    on_fault : str
        What is done then.
    other_publishers : tuple of str
        Who has joined the publisher that was there first.
    frames : tuple of str
        Frame of the publisher that is corrected, and of the other one.
    takes_first : bool
        Whether, of two publishers, the first is corrected.
    learns_range : bool
        Whether what can be true is taken from the record, as no range is stated.
    load : float
        Share of one core that the process uses.
    findings : Findings
    reference_silent_s : float or None
        Time since the last reference message, where there was one.
    zero_stamps : bool
        Whether messages came whose stamp is zero.
    without_clock : bool
        Whether the time is to come from ``/clock`` and does not.
    """

    topic: str
    model_file: str = ""
    failure: str = ""
    designing: bool = False
    publishers: tuple = ()
    refused_subscribers: tuple = ()
    seconds_since_message: float | None = None
    stated_rate_hz: float = 0.0
    sampling_rate_hz: float | None = None
    batch_size: float = 0.0
    warm_up_samples: int | None = None
    counters: dict = dataclasses.field(default_factory=dict)
    changes: dict = dataclasses.field(default_factory=dict)
    stale_s: float | None = None
    stale_after_s: float = 0.5
    faults: tuple = ("", "", "")
    on_fault: str = "covariance"
    other_publishers: tuple = ()
    frames: tuple = ("", "")
    takes_first: bool = True
    learns_range: bool = False
    load: float = 0.0
    findings: Findings = dataclasses.field(default_factory=Findings)
    reference_silent_s: float | None = None
    zero_stamps: bool = False
    without_clock: bool = False


def judge(situation):
    """Level and sentence for a situation.

    Returns
    -------
    level : int
        `OK`, `WARN` or `ERROR`.
    message : str
        Why nothing is being published, where nothing is; otherwise what is wrong, if anything.
    """
    level, message = _judge(situation)
    if situation.without_clock:
        return max(level, WARN), ("use_sim_time is true, but nothing has come on /clock; "
                                  f"{message}")
    return level, message


def _judge(situation):
    reason = _silence(situation)
    if reason:
        level, message = reason
        if situation.stale_s is not None and situation.stale_s > situation.stale_after_s:
            return ERROR, f"{message}; the last output is {situation.stale_s:.1f} s old"
        return reason
    grave, troubles = _grave(situation), _troubles(situation)
    if grave or troubles:
        return (ERROR if grave else WARN), "; ".join([*grave, *troubles])
    return OK, f"correcting at {situation.sampling_rate_hz:.6g} Hz" + _batches(situation)


def _silence(s):
    """Level and reason why nothing comes out, or None if something does."""
    if not s.model_file:
        return ERROR, "no model: set the parameter model_file to a sensor model (YAML)"
    if s.failure:
        return ERROR, f"no filter: {s.failure}"
    return _no_input(s) or _no_output(s)


def _no_input(s):
    if s.seconds_since_message is not None and s.seconds_since_message < SILENT_AFTER_S:
        return None
    if not s.publishers:
        before = "" if s.seconds_since_message is None else " any more"
        return WARN, (f"no publisher on {s.topic}{before}: start the sensor's driver, or remap the "
                      "topic")
    refused = [f"{p.node} {p.refusal}" for p in s.publishers if p.refusal]
    if refused:
        return ERROR, f"nothing can be received on {s.topic}: {'; '.join(refused)}"
    names = ", ".join(p.node for p in s.publishers)
    since = ("yet" if s.seconds_since_message is None
             else f"for {s.seconds_since_message:.0f} s")
    return WARN, f"no message on {s.topic} {since}, though {names} publishes there"


def _no_output(s):
    changes = s.changes
    if changes.get("given"):
        return None
    received = changes.get("samples", 0) + changes.get("other_publisher", 0)
    idle = not (received or changes.get("malformed") or s.designing)
    is_late = s.seconds_since_message is not None and s.seconds_since_message >= _SOME_S
    if idle and is_late:
        return WARN, f"no message on {s.topic} for {s.seconds_since_message:.1f} s"
    grave = _grave(s)
    if changes.get("faulty") and grave:
        return ERROR, "; ".join(grave)
    if not s.takes_first and changes.get("other_publisher"):
        return ERROR, f"{_two_publishers(s)}: none is corrected"
    if not received and changes.get("malformed"):
        return ERROR, (f"all {changes['malformed']} messages of the last second could not be read "
                       f"as the type of {s.topic}")
    if s.zero_stamps:
        return ERROR, (f"the stamps on {s.topic} are zero: let the driver stamp its messages")
    if s.designing:
        return WARN, "the filter is being designed"
    dropped = {name: changes.get(name, 0) for name in _DROPPED}
    if received and sum(dropped.values()) >= received:
        causes = ", ".join(f"{count} {_DROPPED[name]}" for name, count in dropped.items() if count)
        hint = ("; sample_rate_hz may be too low" if dropped["early"] else "")
        return ERROR, f"all {received} samples of the last second were dropped: {causes}{hint}"
    if s.sampling_rate_hz is None:
        return _no_rate(s)
    if idle and s.seconds_since_message is not None:
        return None  # a busy machine looks twice in a row: nothing can have come in between
    if changes.get("restarts", 0) > 1:
        return ERROR, (f"the filter started anew {changes['restarts']} times in the last second "
                       "because of gaps in the stamps: samples are lost, or sample_rate_hz is "
                       "wrong" + _other_rate(s))
    waiting = s.counters.get("waiting", 0)
    return WARN, (f"the filter is warming up: {waiting} of {s.warm_up_samples} samples")


def _no_rate(s):
    waiting = s.counters.get("waiting", 0)
    if waiting >= RATE_SAMPLES:
        return ERROR, ("the sampling rate cannot be estimated: the stamps do not advance; let the "
                       "driver stamp its messages")
    return WARN, f"estimating the sampling rate: {waiting} of {RATE_SAMPLES} samples"


def _two_publishers(s):
    names = f" ({', '.join(s.other_publishers)})" if s.other_publishers else ""
    frame = f" with frame {s.frames[1]!r}" if s.frames[1] and s.frames[1] != s.frames[0] else ""
    return f"{s.topic} has another publisher{names}{frame}"


def _grave(s):
    """What makes the output worthless on some axis, or would."""
    done = {"covariance": "its covariance says so", "drop": "no sample is given",
            "report": "its samples are given as ever"}[s.on_fault]
    grave = [f"axis {axis} {_FAULTS[fault]}: {done}"
             for axis, fault in zip(AXES, s.faults) if fault not in ("", NOT_CONNECTED)]
    if s.changes.get("other_publisher") and s.takes_first:
        grave.append(f"{_two_publishers(s)}, whose {s.changes['other_publisher']} messages were "
                     "dropped")
    return grave


def _troubles(s):
    changes = s.changes
    done = {"covariance": "its covariance says so", "drop": "its covariance says so",
            "report": "its samples are given as ever"}[s.on_fault]
    troubles = [f"axis {axis} has never said anything but zero and counts as not connected: {done}"
                for axis, fault in zip(AXES, s.faults) if fault == NOT_CONNECTED]
    for name, text in _DROPPED.items():
        if changes.get(name) and name != "other_publisher":
            troubles.append(f"{several(changes[name], 'sample')} {text} and "
                            + ("was dropped" if changes[name] == 1 else "were dropped")
                            + (_SHORT_SHOCKS if name == "implausible" and s.learns_range else ""))
    if changes.get("gaps"):
        troubles.append(f"{several(changes['gaps'], 'gap was', 'gaps were')} bridged over "
                        + several(changes.get("filled", 0), "sample"))
    if changes.get("restarts"):
        troubles.append("the filter started anew after longer gaps, "
                        + several(changes["restarts"], "time"))
    if changes.get("malformed"):
        troubles.append(several(changes["malformed"], "message") + " could not be read")
    if changes.get("lost"):
        troubles.append(several(changes["lost"], "message was", "messages were")
                        + " lost on the way: raise depth")
    if changes.get("unpublished"):
        troubles.append(several(changes["unpublished"], "corrected message was",
                                "corrected messages were") + " not taken by the "
                        "middleware: a subscriber that must get all of them is too slow")
    if changes.get("late"):
        troubles.append(f"{several(changes['late'], 'message')} waited too long before "
                        "correction: the machine is too busy")
    refused = [f"{p.node} {p.refusal}" for p in s.publishers if p.refusal]
    if refused:
        troubles.append(f"not received from another publisher: {'; '.join(refused)}")
    if s.refused_subscribers:
        troubles.append("not delivered to a subscriber that asks for another quality of service: "
                        + ", ".join(s.refused_subscribers))
    if _other_rate(s):
        troubles.append(f"sample_rate_hz is {s.stated_rate_hz:.6g}{_other_rate(s)}")
    if changes.get("without_temperature"):
        troubles.append("no temperature has come, so 25 °C is assumed, with an uncertainty of 35 K")
    if changes.get("clipped"):
        troubles.append(several(changes["clipped"], "sample is", "samples are")
                        + " at the limits of the model's range; the variance says so")
    if s.findings.clipped_axes:
        troubles.append(f"axis {', '.join(s.findings.clipped_axes)} seems to be clipped")
    if s.findings.constant:
        troubles.append("the raw signal does not change at all: is the sensor alive?")
    if s.reference_silent_s is not None and s.reference_silent_s > SILENT_AFTER_S:
        troubles.append(f"the reference is lost: no message for {s.reference_silent_s:.0f} s, so "
                        "no errors are published")
    elif s.findings.reference_overlaps is False:
        troubles.append("reference and sensor have no time in common: compare their clocks")
    if s.load > _BUSY:
        troubles.append(f"the process uses {s.load:.0%} of a core")
    return troubles


def _batches(s):
    """What is done with samples that share stamps."""
    return (f"; {s.batch_size:.3g} samples at a time share a stamp: they are taken as uniform, and "
            "given out when the next ones come" if s.batch_size else "")


def _other_rate(s):
    """What the stamps say of a stated rate that they do not have."""
    actual = s.findings.stamp_rate_hz
    if not s.stated_rate_hz or not actual or abs(actual / s.stated_rate_hz - 1) < RATE_SHARE:
        return ""
    return f", but the stamps advance at {actual:.6g} Hz"
