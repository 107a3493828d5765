"""The turn of a sensor that lies turned, among what was found in the reference's axes."""

import dataclasses

import numpy as np

from ..identification.response.excitation import held_out_of
from ..model import AXES, AxisModel, SensorModel
from ..model.effects import known_effects
from .finding import Finding
from .gain import certainty, gain
from .words import gain_words

# What a turn makes of a verdict on the signal that was turned back.
_WITH_TURN = {"consistent": "explained", "unexplained": "partly_explained"}


def with_turn(judged, engine, orientation):
    """A diagnosis of the turned signal, with its turn as a finding and in the extended model.

    Parameters
    ----------
    judged : Diagnosis
    engine : Engine
    orientation : Orientation

    Returns
    -------
    Diagnosis
        The one given where no cause says this turn, as of a mirrored sensor.
    """
    axis, turned = engine.problem.axis, engine.record.sensor
    own = {effect.cause: effect for effect in judged.model.axis(AXES[axis]).effects}
    turns = [cls.of_turn(orientation.rotation, own.get(cause))
             for cause, cls in known_effects().items()]
    effect = next((turn for turn in turns if turn is not None), None)
    if effect is None:
        return judged
    after = engine.problem.errors(engine.search.baseline)
    published = (turned @ orientation.rotation.T)[:, axis]
    simulated = engine.search.baseline.output
    known = engine.wanted & np.isfinite(after)
    rows = known & held_out_of(engine.record.reference[:, axis], known)
    # gravity, which a reference may not show, says nothing of a turn
    published = published - np.mean((published - turned[:, axis])[rows])
    before = after + published - turned[:, axis]
    g = gain(before[rows], after[rows])
    finding = Finding(
        effect, effect.std_of_turn(orientation.angle_std_deg), certainty(g), [],
        [orientation.words, *effect.words_of_turn(orientation.angle_std_deg),
         *gain_words(effect.cause, g, np.inf, [])], g)
    # the model in use knows nothing of the turn
    spread = float(np.std(published[rows]))
    noise = 0.0 if judged.verdict == "undecided" else judged.baseline["noise_rms"]
    left, was = (max(rms**2 - noise**2, 0.0)
                 for rms in (judged.extended["rmse"], g.before))
    return dataclasses.replace(
        judged, verdict=_WITH_TURN.get(judged.verdict, judged.verdict),
        reason=f"turned into the reference's axes, {judged.reason}",
        findings=[*(f for f in judged.findings if f.cause != effect.cause), finding],
        model=_turned_model(judged.model, AXES[axis], effect),
        baseline={**judged.baseline, "rmse": g.before, "nrmse": g.before / spread},
        unexplained_fraction=min(left / was, 1.0) if was else 0.0,
        budget=[*engine.budget_between(published, simulated, engine.record.valid)
                .as_list("baseline"),
                *(entry for entry in judged.budget if entry["of"] == "extended")])


def _turned_model(model, axis, effect):
    """A model with the turn on each axis. What was found to be added to the turned signal of one
    axis, each of the sensor's own axes has its share of."""
    found, axes = model.axis(axis), {}
    for name in AXES:
        own = model.axis(name)
        there = {e.cause for e in own.effects}
        share = float(effect.share_of_axes(AXES.index(name))[AXES.index(axis)])
        added = [e.in_share(share) for e in found.effects
                 if e.adds and (name == axis or e.cause not in there)]
        replaced = {effect.cause, *(e.cause for e in added)}
        axes[name] = AxisModel(own.core, (*(e for e in own.effects if e.cause not in replaced),
                                          effect, *added))
    return SensorModel(model.core, model.effects, axes, model.metadata, model.reference_faults)
