"""From measured pairs to a sensor model with standard uncertainties."""

from pathlib import Path

import numpy as np

from ..errors import FracAccelError, IdentificationError
from ..record import Record
from .candidate import STRUCTURES as _STRUCTURES
from .candidate import Candidate, Data
from .choice import choose, choose_classical, choose_of_several
from .excitation import Excitation
from .points import ResponsePoints, response_points
from .result import Identification, identification

__all__ = ["STRUCTURES", "Excitation", "Identification", "ResponsePoints", "identify",
           "response_points"]

STRUCTURES = ("auto", "classical", *_STRUCTURES)
# glibc gives free memory back to the system from twice the largest block on that was ever freed
# (mallopt(3), M_MMAP_THRESHOLD), and a sixth of the time went into getting it again. A block of
# this many numbers (16 MB), freed without having been touched, lets it keep 32 MB.
_FREED = 2 << 20


def identify(pair, axis="x", structure="auto", provenance=None, progress=None, records=None):
    """Identify a sensor model.

    Parameters
    ----------
    pair : Record, str or Path, or a list of them
        A measured pair, or a bag with one on the default topics. Of several, each gets a model
        that is judged on all others, and the result is their mean.
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
        Called with a few words before each step that may take seconds.
    records : list of str, optional
        Names of several pairs, for messages.

    Returns
    -------
    Identification

    Raises
    ------
    IdentificationError
        If the data cannot identify the model; says what is missing.
    """
    if structure not in STRUCTURES:
        raise FracAccelError(f"structure: {structure!r} given, expected one of "
                             f"{', '.join(STRUCTURES)}")
    np.empty(_FREED)
    pairs = pair if isinstance(pair, (list, tuple)) else [pair]
    if not pairs:
        raise IdentificationError("no record given, expected at least one")
    records = records or [Path(pair).name if isinstance(pair, (str, Path)) else f"record {i + 1}"
                          for i, pair in enumerate(pairs)]
    progress = progress or (lambda words: None)
    datas = [Data.of(Record.load(pair, axis=axis) if isinstance(pair, (str, Path)) else pair, axis,
                     progress) for pair in pairs]
    agreeing = None
    if len(datas) > 1:
        structure = {"classical": "oscillator"}.get(structure, structure)
        chosen, reason, agreeing = choose_of_several(structure, datas, records)
    elif structure == "auto":
        chosen, reason = choose(datas[0])
    elif structure == "classical":
        chosen, reason = choose_classical(datas[0])
    else:
        chosen, reason = Candidate.of(structure, datas[0]), "asked for"
    return identification(chosen, reason, datas, records, axis, provenance or {}, agreeing)
