"""What a bag is, before it is worked on: its content's hash, its date, its sensor."""

import datetime
from pathlib import Path

from ..errors import FracAccelError
from ..io.bag import BagReader
from ..io.regular_file import sha256_of
from .places import at_hand


def inspect(request):
    """Look at a bag; the first of the two functions that a worker runs for each.

    Parameters
    ----------
    request : dict
        ``bag``: its URL; ``sensor``: the topic.

    Returns
    -------
    dict
        ``bag``, ``sha256``, ``date`` (of the first sample, in UTC), ``start_ns``, ``frame``, and
        ``error``, which is empty where it can be worked on. It never raises.
    """
    result = {"bag": request["bag"], "sha256": "", "date": "unknown", "start_ns": None,
              "frame": "", "error": ""}
    try:
        with at_hand(request["bag"]) as path:
            result["sha256"] = content_hash(path)
            stamp, result["frame"] = _first_sample(path, request["sensor"])
            result["start_ns"] = stamp
            result["date"] = str(datetime.datetime.fromtimestamp(
                stamp * 1e-9, datetime.timezone.utc).date())
    except (FracAccelError, OSError, OverflowError) as error:
        # the bag has a column of its own
        result["error"] = " ".join(str(error).split()).removeprefix(f"{request['bag']}: ")
    return result


def content_hash(path):
    """SHA-256 of a file, or of all bags of a folder one after the other."""
    path = Path(path)
    return sha256_of(*(sorted(path.glob("*.mcap")) if path.is_dir() else [path]))


def _first_sample(path, topic):
    reader = BagReader(path)
    for _, samples in reader.samples([topic]):
        if len(samples.stamps_ns):
            return int(samples.stamps_ns[0]), samples.frame_id
    raise FracAccelError(f"{path}: topic {topic} has no messages")
