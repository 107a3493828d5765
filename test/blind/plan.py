"""Which cases the suite runs."""

from typing import NamedTuple

import numpy as np
from rig.hidden import draw_case, draw_causes
from rig.road_cases import ROAD_CAUSES, ROAD_VARIANTS, draw_road_case, draw_road_causes
from rig.sensor import CAUSES, SECOND_SET, UNCATALOGUED

ON_ROADS = ("road_single", "road_multiple", "road_clean", "road_outside")
GROUPS = ("single", "multiple", "clean", "outside", "without_model", "power", "second_set",
          *ON_ROADS)
LAB_VARIANTS = ("hardening_hysteresis", "turned_axes")

PER_CAUSE, CLEAN, MULTIPLE, OUTSIDE_PER_CAUSE, POWER_PER_CAUSE = 20, 100, 60, 10, 24
SECOND_SET_PER_CAUSE = 12
ROAD_PER_CAUSE, ROAD_CLEAN, ROAD_MULTIPLE, ROAD_OUTSIDE_PER_CAUSE = 6, 60, 40, 6
WITHOUT_MODEL_EVERY = 10
POWER_TIMES_NOISE = 0.03, 10.0


class Trial(NamedTuple):
    """One diagnosis.

    Attributes
    ----------
    group : str
        Of `GROUPS`.
    name : str
        Unique.
    seed : int
    causes : tuple of str
        What is hidden; a variant (`rig.scaling.VARIANTS`) stands for its cause.
    times_noise : float or None
        RMS of the effect over the noise's; None for that of `rig.hidden.draw_case`.
    """

    group: str
    name: str
    seed: int
    causes: tuple
    times_noise: float | None = None

    def case(self):
        """The `HiddenCase` that this trial is about, drawn anew."""
        draw = draw_road_case if self.group in ON_ROADS else draw_case
        return draw(self.seed, self.causes, times_noise=self.times_noise)


def plan(seed_set, groups=GROUPS, first=None):
    """Trials in an order in which every part of the suite advances evenly.

    Parameters
    ----------
    seed_set : int
        Sets have no seed in common: what was tuned on one is judged on another.
    groups : sequence of str
    first : int, optional
        Only so many of each cause, and of the clean and the multiple ones.

    Returns
    -------
    list of Trial
    """
    base = 100_000 * (seed_set + 1)

    def trials(group, causes, count, offset, strengths=None):
        label = "+".join(sorted(causes)) or "none"
        return [Trial(group, f"{group}/{label}/{i}", base + offset + i, tuple(sorted(causes)),
                      None if strengths is None else float(strengths[i])) for i in range(count)]

    single = [trials("single", [cause], PER_CAUSE, 0) for cause in CAUSES]
    clean = trials("clean", [], CLEAN, 10_000)
    smallest, largest = POWER_TIMES_NOISE
    shares = (np.arange(POWER_PER_CAUSE) + 0.5) / POWER_PER_CAUSE
    # strong and weak ones alternate, so that the first few span the range
    shares = shares[np.argsort(np.arange(POWER_PER_CAUSE) * 7 % POWER_PER_CAUSE)]
    strengths = smallest * (largest / smallest) ** shares

    def several(group, draw, count, offset):
        return [t for i in range(count) for t in _renumbered(trials(
            group, draw(base + offset + i, 2 + i % 2), 1, offset + i), i)]

    families = {
        "single": single,
        "clean": [clean],
        "multiple": [several("multiple", draw_causes, MULTIPLE, 20_000)],
        "outside": [trials("outside", [cause], OUTSIDE_PER_CAUSE, 30_000)
                    for cause in UNCATALOGUED],
        # the same records as with a model
        "without_model": [[t._replace(group="without_model", name=f"without_model/{t.name}")
                           for t in family[::WITHOUT_MODEL_EVERY]] for family in (*single, clean)],
        "power": [trials("power", [cause], POWER_PER_CAUSE, 40_000, strengths)
                  for cause in CAUSES],
        "second_set": [trials("second_set", [cause], SECOND_SET_PER_CAUSE, 50_000)
                       for cause in (*SECOND_SET, *LAB_VARIANTS)],
        "road_single": [trials("road_single", [cause], ROAD_PER_CAUSE, 60_000)
                        for cause in (*ROAD_CAUSES, *ROAD_VARIANTS)],
        "road_multiple": [several("road_multiple", draw_road_causes, ROAD_MULTIPLE, 70_000)],
        "road_clean": [trials("road_clean", [], ROAD_CLEAN, 80_000)],
        "road_outside": [trials("road_outside", [kind], ROAD_OUTSIDE_PER_CAUSE, 90_000)
                         for kind in UNCATALOGUED],
    }
    chosen = [family[:first] for group in groups for family in families[group]]
    order = [(i / len(family), trial) for family in chosen for i, trial in enumerate(family)]
    return [trial for _, trial in sorted(order, key=lambda entry: entry[0])]


def _renumbered(trials, number):
    return [t._replace(name=t.name.rsplit("/", 1)[0] + f"/{number}") for t in trials]
