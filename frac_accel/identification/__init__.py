"""From measured pairs to a sensor model with standard uncertainties."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FracAccelError, IdentificationError, ModelError, naming
from ..io.samples import Samples
from ..model import SensorModel
from ..record import Record
from ..record.sources import is_bag, pair_of
from .judge.candidate import STRUCTURES as _STRUCTURES
from .judge.candidate import Candidate, Data
from .judge.choice import choose, choose_classical, choose_of_several
from .response.excitation import Excitation
from .response.points import ResponsePoints, response_points
from .result import Identification, identification

__all__ = ["STRUCTURES", "Excitation", "Identification", "ResponsePoints", "identify",
           "response_points"]

STRUCTURES = ("auto", "classical", *_STRUCTURES)
# glibc gives free memory back to the system from twice the largest block on that was ever freed
# (mallopt(3), M_MMAP_THRESHOLD), and a sixth of the time went into getting it again. A block of
# this many numbers (32 MB, the largest that counts), freed untouched, lets it keep 64 MB.
_FREED = (4 << 20) - 1024


def identify(pair: Any, axis: str = "x", structure: str = "auto",
             provenance: dict | None = None, progress: Callable | None = None,
             records: list | None = None, sampling_rate_hz: float | None = None
             ) -> Identification:
    """Identify a sensor model.

    Parameters
    ----------
    pair : Record, str, Path or tuple, or a list of them
        A measured pair, a bag with one on the default topics, or (reference, sensor) as `Samples`
        or as arrays of shape (n,) or (n, 3). Of several, each gets a model that is judged on all
        others, and the result is their mean.
    axis : {"x", "y", "z"}
    structure : {"auto", "arx", "oscillator", "fractional", "fractional_transfer_function", \
            "gain", "classical"}
        Rational transfer function in z, classical seismic sensor, one with a damping of free
        order, or the general equation with two free orders on the left and, where the data call
        for it, a slope term of free order on the right, or a gain without dynamics. ``classical``
        is an oscillator, or a gain where no resonance shows. ``auto`` prefers the gain there, and
        otherwise chooses between the first three:
        the fractional one only where its order differs from 1 by three standard uncertainties, it
        predicts held-out data better and explains a good part of what the classical model lacks;
        the one in z, which names no cause, only where it predicts them clearly better than both.
        Of several records it chooses between the two oscillators.
    provenance : dict, optional
        Where the data come from; becomes part of the model.
    progress : callable, optional
        Called before each step that may take seconds, with a few words and the share that is done.
    records : list of str, optional
        Names of several pairs, for messages.
    sampling_rate_hz : float, optional
        Of arrays [Hz].

    Returns
    -------
    Identification

    Raises
    ------
    IdentificationError
        If the data cannot identify the model; says what is missing.
    FracAccelError
        If arrays are no pair: wrong shapes, values that are not finite, or no rate.

    Examples
    --------
    >>> import numpy as np, frac_accel
    >>> from frac_accel.model.core import Oscillator
    >>> rng = np.random.default_rng(1)
    >>> motion = np.convolve(rng.normal(size=8000), np.hanning(5), "same")
    >>> output = frac_accel.simulate(frac_accel.SensorModel(Oscillator(90.0, 0.2)), motion,
    ...                              1000.0, "x") + 1e-3 * rng.normal(size=8000)
    >>> found = frac_accel.identify((motion, output), structure="oscillator",
    ...                             sampling_rate_hz=1000.0)
    >>> round(found.parameters["natural_frequency_hz"]["value"], 1)
    90.0
    """
    if structure not in STRUCTURES:
        raise FracAccelError(f"structure: {structure!r} given, expected one of "
                             f"{', '.join(STRUCTURES)}")
    np.empty(_FREED)
    pairs = [pair] if isinstance(pair, Record) or is_bag(pair) or _is_pair(pair) else list(pair)
    if not pairs:
        raise IdentificationError("no record given, expected at least one")
    records = records or [Path(pair).name if isinstance(pair, (str, Path)) else f"record {i + 1}"
                          for i, pair in enumerate(pairs)]
    step = _counted(progress, structure, len(pairs))
    datas = []
    for name, pair in zip(records, pairs):
        with naming(name if len(pairs) > 1 else ""):
            datas.append(Data.of(_pair(pair, axis, sampling_rate_hz), axis, step))
    agreeing = None
    if len(datas) > 1:
        structure = {"classical": "oscillator"}.get(structure, structure)
        chosen, reason, agreeing = choose_of_several(structure, datas, records)
    elif structure == "auto":
        chosen, reason = choose(datas[0])
    elif structure == "classical":
        chosen, reason = choose_classical(datas[0])
    else:
        chosen, reason = Candidate.of(structure, datas[0]), "requested"
    found = identification(chosen, reason, datas, records, axis, provenance or {}, agreeing)
    _require_loadable(found.model)
    return found


def _require_loadable(model):
    """Refuse a model that no file may hold, as stamps make it that are wrong by orders."""
    try:
        SensorModel.from_dict(model.to_dict())
    except ModelError as error:
        # a place in a file is no user's word here
        words = re.sub(r"^effects\[(\d+)\]\.",
                       lambda found: f"{model.effects[int(found[1])].cause}, ", str(error))
        raise IdentificationError(f"what fits best is no sensor: {words}; are the stamps right?") \
            from None


def _counted(progress, structure, records):
    """Tells `progress` of a step its share of all that there will be, as far as that is known."""
    structures = 1
    if structure == "auto":
        structures = 4 if records == 1 else 2
    expected = records * 2 + structures * (records + 1) + (records == 1)
    done = 0

    def step(words):
        nonlocal done
        if progress:
            progress(words, min(done / expected, 1.0))
        done += 1
    return step


def _is_pair(source):
    """Whether this is (reference, sensor), and not several pairs."""
    return isinstance(source, (tuple, list)) and len(source) == 2 and all(
        isinstance(part, Samples) or not (isinstance(part, (Record, tuple)) or is_bag(part))
        for part in source)


def _pair(source, axis, sampling_rate_hz):
    if isinstance(source, Record):
        return source
    if is_bag(source):
        return Record.load(source, axis=axis)
    return Record.of(*pair_of(source, sampling_rate_hz, axis), axis)
