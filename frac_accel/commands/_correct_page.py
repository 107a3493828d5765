"""The page of `correct --report`: each axis before and after."""

import dataclasses

import numpy as np

from ..correction.design import plateau
from ..errors import FracAccelError
from ..io.bag import read_bag
from ..model import AXES
from ..report.correction import BeforeAfter, correction_page, filter_words
from ..report.quantity import percent
from ..validation import compare
from ._common import provenance


def page(kept, reader, corrector, arguments):
    """Page of before and after, with errors where the bag has a reference to compare with."""
    raw, index, corrected = kept
    design, summary = corrector.design, corrector.design.summary()
    reference = read_bag(arguments.bag, [arguments.reference])[arguments.reference] \
        if arguments.reference in reader.topics else None
    words, seen = [f"{corrector.counters['given']} of {corrector.counters['samples']} samples "
                   f"corrected at {summary['sampling_rate_hz']:.6g} Hz."], []
    for column, axis in enumerate(AXES):
        if not np.ptp(corrected.values[:, column]):
            words.append(f"Axis {axis} does not move, and is not shown.")
            continue
        words.append(filter_words(axis, summary))
        drawn = BeforeAfter(
            axis, summary["sampling_rate_hz"], corrected.stamps_ns,
            raw.values[index, column] / plateau(design.model.axis(axis), design.model.band_hz),
            corrected.values[:, column], np.sqrt(corrected.variance[:, column]),
            summary["axes"][axis]["band_hz"])
        try:
            if reference is not None:
                found = compare(reference, raw, corrected, design, axis)
                drawn = dataclasses.replace(
                    drawn, stamps_ns=found.stamps_ns, before=found.before, after=found.after,
                    std=found.std, reference=found.reference)
                words.append(f"Axis {axis}: NRMSE {percent(found.scaled.total.nrmse)} before, "
                             f"{percent(found.corrected.total.nrmse)} after correction.")
        except FracAccelError as error:
            words.append(f"Axis {axis} is shown without its reference: {error}.")
        seen.append(drawn)
    source = provenance(arguments.bag, f"frac_accel correct {arguments.bag} --model "
                        f"{arguments.model} --sensor {arguments.sensor}")
    return correction_page("Correction", seen, words, source, corrector.model)
