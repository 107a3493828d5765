"""Whether a sensor follows its reference, and not the other way round."""

import numpy as np

from ..errors import FracAccelError
from ..model.core import Gain
from ..model.effects.base import INTERFERENCE
from ..record.orientation import turned_away
from ..simulation import AxisSimulator
from .leftover import related

# Share of its power in which a signal must follow the model the wrong way round, and the share of
# what is left the right way round that may be left then, for the pair to count as exchanged.
_ALIKE = 0.5
_EXCHANGED = 0.3
# Causes that are tried before a pair counts as exchanged.
_TRIED = 4


def require_relation(engine, axis, seed):
    """Refuse a sensor that does not follow the reference."""
    p = engine.problem
    start = p.simulate({**engine.search.base, **(seed or {})})
    _require_direction(engine, axis, start)
    follows, share = related(p.measured, start, p.used)
    if follows or related_in_fast_motion(p.measured, start, p.used)[0]:
        return
    if _related_beside_interference(engine, start):
        return
    hint = turned_away(p.record, axis) or "they do not belong together"
    raise FracAccelError(f"axis {axis}: the sensor does not follow the reference (they share "
                         f"{max(share, 0):.2%} of the power); {hint}")


def related_in_fast_motion(measured, expected, used):
    """As `related`, by what changes from sample to sample: slow motion, which a high-pass takes
    away, says nothing then."""
    both = used[1:] & used[:-1]
    return related(*(np.where(both, np.diff(values), 0.0) for values in (measured, expected)), both)


def _related_beside_interference(engine, start):
    """Whether a sensor follows the reference once what is louder than the motion, and has nothing
    to do with it, is taken off."""
    search, p = engine.search, engine.problem
    bare = search.baseline
    fits = search.fit_all([search.begun(bare, cause, begin) for _, cause, begin in
                           search.screen(bare) if begin.stage == INTERFERENCE])
    return any(related(p.measured - engine.added(fit, cause), start, p.used)[0]
               for fit in fits for cause in fit.causes - bare.causes)


def _require_direction(engine, axis, start):
    """Refuse a pair that the model fits far better the other way round."""
    p = engine.problem
    own = p.baseline.axis(p.axis)
    if isinstance(own.core, Gain) and not own.effects:
        return  # which answers alike either way
    reference, used = p.record.reference[:, p.axis], p.used
    swapped = AxisSimulator(p.measured, p.rate, p.record.temperature_c)
    backward = _shared(reference, swapped.simulate(p.baseline.axis(p.axis)), used)
    if backward > _ALIKE and 1 - backward < _EXCHANGED * (1 - _shared(p.measured, start, used)) \
            and _best_of_one(engine, p.measured, used) < backward:
        raise FracAccelError(
            f"axis {axis}: reference and sensor are exchanged: the reference follows the model's "
            f"answer to the sensor ({backward:.1%} of its power), and not the other way round; "
            "exchange the topics of --reference and --sensor")


def _best_of_one(engine, measured, used):
    """Share of the sensor's power that the model explains the right way round with one cause."""
    search = engine.search
    bare = search.baseline
    fits = search.fit_all([search.begun(bare, cause, begin)
                           for _, cause, begin in search.screen(bare)[:_TRIED]])
    return max((_shared(measured, fit.output, used) for fit in fits), default=0.0)


def _shared(one, other, used):
    """Square of the correlation of two signals where they count."""
    one, other = one[used] - one[used].mean(), other[used] - other[used].mean()
    return float((one @ other)**2 / max((one @ one) * (other @ other), 1e-300))
