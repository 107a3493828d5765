"""Measurement data format of ASAM (MDF4), by asammdf: a channel group for each topic.

The group's comment is the topic, and in a line of its own the frame.
"""

import datetime
import faulthandler
import gc
import logging
import multiprocessing
import re
import sys

import numpy as np

from ...errors import BagError
from .columns import Group, columns_of

_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc)
_VERSION = "4.10"
_FRAME = re.compile(r"^frame_id: (.*)$", re.MULTILINE)


def read_mdf(path):
    """Groups of the channel groups, with the channels' units and the stamps of their masters.

    They are read in a process of its own: of damaged files, asammdf's compiled part ends some.
    """
    import asammdf  # noqa: F401  where it is missing, that is told by this process
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    reader = context.Process(target=_send, args=(theirs, path), daemon=True)
    reader.start()
    theirs.close()
    try:
        groups, error = ours.recv()
    except EOFError:
        groups, error = None, BagError(f"{path}: cannot be read: it is damaged, and ends asammdf")
    finally:
        ours.close()
        reader.kill()
        reader.join()
    if error:
        raise error
    return groups


def _send(pipe, path):
    faulthandler.disable()
    try:
        pipe.send((_read(path), None))
    except (BagError, OSError, MemoryError) as error:
        pipe.send((None, error))


def _read(path):
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
            frame = _FRAME.search(str(group.channel_group.comment))
            groups.append(Group.of([("stamp", stamps, "ns"), *(
                [("frame_id", np.array([frame[1]]), "")] if frame else []), *(
                (signal.name, signal.samples, signal.unit) for signal in signals
                if signal.samples.ndim == 1 and signal.samples.dtype.kind in "fiu")]))
    except Exception as error:  # asammdf raises whatever its parts do
        raise BagError(f"{path}: cannot be read: {_words(error)}") from None
    finally:
        mdf.close()
    return groups


def write_mdf(path, topics):
    """Write topics."""
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
                    in columns], comment=f"{topic}\nframe_id: {content.frame_id}",
                   common_timebase=True)
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
