"""Which causes the axes of one sensor have in common."""

import dataclasses

from ..model import is_link
from ..model.effects.base import CROSS_AXIS

# Share of the power of what is left that comes from across, from which on it asks for an answer.
_FROM_ACROSS = 0.2


@dataclasses.dataclass(frozen=True)
class OtherAxes:
    """What the axes that are not diagnosed have as well, of the causes of the one that is.

    Attributes
    ----------
    in_own_core : tuple of str
        Causes that say what a core is that nobody has stated: it is that of all axes.
    alike : bool
        Whether all axes have the same mount, dynamics and filters, as those of one housing do.
    """

    in_own_core: tuple = ()
    alike: bool = False

    def have(self, effect):
        """Whether the other axes have an effect too."""
        return effect.common_to_axes or effect.of_reference or effect.cause in self.in_own_core \
            or (self.alike and is_of_all_if_alike(effect))

    def common(self, effects):
        """Of these effects, by cause, what the other axes have too."""
        return {cause: effect for cause, effect in effects.items() if self.have(effect)}

    def shown_by(self, effects):
        """The same as far as a set of effects (by cause) shows it: by what comes across."""
        return dataclasses.replace(self, alike=self.alike and _crosses(effects))

    def said(self, finding):
        """A finding with words where it is written for all axes."""
        if not (self.alike and is_of_all_if_alike(finding.effect)):
            return finding
        return dataclasses.replace(finding, evidence=[
            *finding.evidence,
            "written for all axes: what comes across from the others shows it as well"])


# Nothing but what is common to all axes by its nature.
UNLIKE = OtherAxes()


def _crosses(effects):
    return any(effect.stage == CROSS_AXIS for effect in effects.values())


def is_of_all_if_alike(effect):
    """Whether an effect is one of mount, dynamics or filters, and acts on what comes across."""
    return acts_before(effect) and not effect.of_reference


def acts_before(effect):
    """Whether an effect changes dynamics before axes are mixed."""
    return effect.stage < CROSS_AXIS and (
        effect.restates_core or (is_link(effect) and not effect.is_constant))


def may_be_unlike(engine, best):
    """Whether a set of causes of axes that are alike may be another one where they are not: with
    something across, it leaves more than noise, or leaves as little without their filters."""
    p, fitted = engine.problem, (engine.part or engine)
    if not p.others.alike:
        return False
    crosses = _crosses(best.effects)
    if not fitted.noise_only(best):
        shares = {part: share for share, part in fitted.structure(best)}
        return crosses or shares.get("across", 0.0) > _FROM_ACROSS
    if not crosses or not any(is_of_all_if_alike(effect) and effect.cause not in
                              p.others.in_own_core for effect in best.effects.values()):
        return False
    unlike = fitted.problem.beside(dataclasses.replace(p.others, alike=False))
    return unlike.fit(best.effects).cost - best.cost < fitted.threshold(best)
