"""Whether the stamps show that a reference is late, whatever leads of the sensor say."""

import numpy as np

from ..model import AxisModel, is_link
from ..model.core import Gain
from ..record.relation import refined
from ..simulation import AxisSimulator


def leads(effect):
    """Whether an effect of the sensor is a high-pass, which is ahead of slow motion."""
    return is_link(effect) and not effect.of_reference and bool(np.any(effect.zeros() == 0))


def is_reference_late(problem, effects):
    """Whether the sensor shows the motion before the reference does, though not for a high-pass
    among these effects (by cause): beside the reference behind that, too."""
    record, axis = problem.record, problem.axis
    links = tuple(filter(leads, problem.axis_model(effects).effects))
    if not record.is_reference_late or not links:
        return record.is_reference_late
    behind = AxisSimulator(record.reference[:, axis], record.sampling_rate_hz).respond(
        AxisModel(Gain(1.0), links))
    offset = refined(behind[:, None], record.sensor[:, [axis]], record.valid,
                     record.sampling_rate_hz, 0.0, record.band_hz)
    return offset is not None and record.is_reference_late_by(offset.seconds + record.lag_s)
