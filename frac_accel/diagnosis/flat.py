"""Whether a record without a model is better begun with a gain than with an oscillator."""

from ..model import SensorModel
from ..model.core import Gain
from ..model.effects import Effect, known_effects
from .engine import Engine

# Links that are fitted, and the share of an oscillator's residual power that one may leave.
_FITTED = 4
_FAR_LESS = 0.1


def flat_instead(record, column, used, model, opened, seed, limit=None):
    """A gain with one link that explains far more than the oscillator that was identified.

    A filter of the conditioner has no resonance, but an oscillator bends itself to look like it,
    and every cause that is then found makes up for what it cannot.

    Parameters
    ----------
    record : Record
    column : int
    used : ndarray of bool, shape (n,)
    model : SensorModel
        With the oscillator.
    opened : callable
        (model) -> causes by name that the model leaves open, with which each fit begins.
    seed : dict of str to Effect
        What the oscillator was identified with.
    limit : TimeLimit, optional

    Returns
    -------
    (SensorModel, dict of str to Effect), or None
        With the gain, and what to begin with instead.
    """
    own = Engine(record, column, model, used, opened(model), limit=limit)
    before = own.search.fit({**own.search.base, **seed})
    flat = SensorModel(Gain(model.axes[column].core.sensitivity))
    links = [cause for cause, effect in known_effects().items()
             if effect.acts_on(flat.core) and not effect.read_off and not effect.of_reference
             and effect.transfer_function is not Effect.transfer_function]
    engine = Engine(record, column, flat, used, opened(flat), links, limit=limit)
    start = engine.search.fit({**engine.search.base, **seed})
    fits = engine.search.fit_all([
        engine.search.begun(start, cause, begin)
        for _, cause, begin in engine.search.screen(start)[:_FITTED]], start.cost)
    if not fits or fits[0].cost > _FAR_LESS * before.cost:
        return None
    return flat, {cause: effect for cause, effect in fits[0].effects.items()
                  if cause not in engine.search.base}
