"""A core that was identified, with what fits have found of it beside the causes, as one core."""

import dataclasses

from ..model import AXES, AxisModel, SensorModel
from ..model.effects.base import GAIN
from ..model.parameters import parameter_fields, rescaled, unit_power


def in_own_core(model, findings, restating, axis):
    """An extended model whose core says by itself what causes beside it say of it.

    What acts before the gain has its parameters in units of the core's output: these grow with the
    sensitivity. The simulated output is the same.

    Parameters
    ----------
    model : SensorModel
    findings : list of Finding
    restating : collection of str
        Causes that say anew what the core says, which no model in use has stated.
    axis : {"x", "y", "z"}

    Returns
    -------
    (SensorModel, list of Finding)
    """
    own = model.axis(axis)
    core = own.core
    for effect in own.effects:
        core = effect.restated(core) if effect.cause in restating else core
    factor = core.sensitivity / own.core.sensitivity
    if core == own.core or not factor > 0:
        return model, findings

    def mended(effect):
        return rescaled(effect, factor) if effect.stage < GAIN else effect
    axes = {name: AxisModel(core, tuple(mended(effect) for effect in model.axis(name).effects
                                        if effect.cause not in restating)) for name in AXES}
    findings = [dataclasses.replace(f, effect=mended(f.effect), std=_std(f, factor))
                for f in findings]
    return SensorModel(core, (), axes, model.metadata, model.reference_faults), findings


def _std(finding, factor):
    effect = finding.effect
    powers = {field.name: unit_power(field) if effect.stage < GAIN else 0
              for field in parameter_fields(type(effect))}
    return {name: std * factor**powers[name] for name, std in finding.std.items()}
