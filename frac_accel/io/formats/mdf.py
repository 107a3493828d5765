"""Measurement data format of ASAM (MDF4), by asammdf: a channel group for each topic."""

import datetime
import gc
import logging
import sys

import numpy as np

from ...errors import BagError
from .columns import Group, columns_of

_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc)
_VERSION = "4.10"


def read_mdf(path):
    """Groups of the channel groups, with the channels' units and the stamps of their masters."""
    mdf = _open(path)
    start = mdf.header.start_time
    start = start if start.tzinfo else start.replace(tzinfo=datetime.timezone.utc)
    start_ns = (start - _EPOCH) // datetime.timedelta(microseconds=1) * 1000
    groups = []
    try:
        for number, group in enumerate(mdf.groups):
            signals = [mdf.get(group=number, index=index, raw=False)
                       for index in range(len(group.channels))
                       if index != mdf.masters_db.get(number)]
            if not signals:
                continue
            seconds = np.asarray(signals[0].timestamps, float)
            stamps = start_ns + np.round(seconds * 1e9).astype(np.int64)
            groups.append(Group.of([("stamp", stamps, "ns"), *(
                (signal.name, signal.samples, signal.unit) for signal in signals
                if signal.samples.ndim == 1 and signal.samples.dtype.kind in "fiu")]))
    except Exception as error:  # asammdf raises whatever its parts do
        raise BagError(f"{path}: cannot be read: {_words(error)}") from None
    finally:
        mdf.close()
    return groups


def write_mdf(path, topics):
    """Write topics; the frame is not kept."""
    from asammdf import MDF, Signal
    first = min((int(content.stamps_ns.min()) for content in topics.values()
                 if len(content.stamps_ns)), default=0)
    start_s = first // 10**9
    mdf = MDF(version=_VERSION)
    mdf.header.start_time = _EPOCH + datetime.timedelta(seconds=start_s)
    for topic, content in topics.items():
        (_, stamps), *columns = columns_of(content)
        seconds = (stamps - start_s * 10**9) * 1e-9
        mdf.append([_signal(Signal, f"{topic}/{name}", values, seconds) for name, values
                    in columns], comment=topic, common_timebase=True)
    mdf.save(path, overwrite=True)
    mdf.close()


def _signal(signal, name, values, seconds):
    name, _, unit = name.partition(" [")
    return signal(samples=np.asarray(values), timestamps=seconds, name=name,
                  unit=unit.removesuffix("]"))


def _open(path):
    from asammdf import MDF
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)
    # what asammdf has half made complains when it goes, in lines of its own
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
    words = ""
    try:
        return MDF(path)
    except Exception as error:  # as above
        words = _words(error)
        error.__traceback__ = error.__context__ = None
    finally:
        if words:
            gc.collect()
        sys.unraisablehook = hook
    raise BagError(f"{path}: is no MDF file that asammdf can read: {words}")


def _words(error):
    return " ".join(str(error).split()) or type(error).__name__
