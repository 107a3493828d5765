"""Which causes the axes of one sensor have in common."""

import dataclasses

import numpy as np

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
        Whether all axes have the same mount, dynamics and filters, as those of one housing do. What
        comes across shows whether they do.
    """

    in_own_core: tuple = ()
    alike: bool = False

    def have(self, effect):
        """Whether the other axes have an effect too."""
        return effect.common_to_axes or effect.cause in self.in_own_core \
            or (self.alike and is_of_all_if_alike(effect))

    def said(self, finding):
        """A finding with words where it is written for all axes."""
        if not (self.alike and is_of_all_if_alike(finding.effect)):
            return finding
        return dataclasses.replace(finding, evidence=[
            *finding.evidence,
            "written for all axes: what comes across from the others shows it as well"])


# Nothing but what is common to all axes by its nature.
UNLIKE = OtherAxes()


def is_of_all_if_alike(effect):
    """Whether an effect is one of mount, dynamics or filters, and acts on what comes across."""
    return effect.stage < CROSS_AXIS and not effect.of_reference and (
        effect.restates_core or (is_link(effect) and not effect.is_constant))


def may_be_alike(engine, best):
    """Whether something comes across beside a set of causes that leaves more than noise, or that
    has filters of one axis alone."""
    p, fitted = engine.problem, (engine.part or engine)
    if not any(np.ptp(p.record.reference[:, axis]) for axis in range(3) if axis != p.axis):
        return False
    crosses = any(effect.stage == CROSS_AXIS for effect in best.effects.values())
    own = any(is_of_all_if_alike(effect) and not p.others.have(effect)
              for effect in best.effects.values())
    if fitted.noise_only(best):
        return crosses and own
    shares = {part: share for share, part in fitted.structure(best)}
    return crosses or shares.get("across", 0.0) > _FROM_ACROSS
