"""Which other sets of causes were fitted, and why they lost."""

import numpy as np

from ..diagnosis.engine import noise_peak

# Sets of causes in the table.
_MOST = 14
# Costs over the best one's up to which a set describes the record as well.
_AS_WELL = 1.02


def rivals(section, found):
    """Fill a section with the sets of causes that were fitted, the best ones first."""
    engine, best = found.engine, found.best
    base = set(engine.search.base)
    samples = engine.problem.count
    variance = best.cost / samples * noise_peak(best.residual, engine.problem.used)
    own = engine.score(best, variance)
    fits = sorted((fit for fit in engine.search.fits.values() if fit.causes != best.causes),
                  key=lambda fit: fit.cost)
    bare = engine.search.fit(engine.search.base)
    shown = [best, *[fit for fit in fits if fit is not bare][:_MOST]]
    if bare is not best:
        shown.append(bare)
    chosen = "fits best, but is not sure: see above" if found.suspects else "chosen"
    rows = [[" + ".join(sorted(fit.causes - base)) or "(the model in use)",
             str(len(fit.unknowns)), f"{np.sqrt(fit.cost / samples):.4g}",
             "–" if fit is best else f"{engine.score(fit, variance) - own:.3g}",
             chosen if fit is best else _why(fit, best)] for fit in shown]
    section.table(
        ["causes", "parameters", "RMSE", "behind by", "why not"], rows,
        f"The sets of causes that describe the whole record best, of "
        f"{len(engine.search.fits)} that were fitted; those that fell far behind were not fitted "
        "to the end. Behind by: in variances of the noise, with a penalty for each parameter; "
        "less than 10 does not tell two sets apart."
        + (f" In every set: {', '.join(sorted(base))}, within what the model in use leaves open."
           if base else ""))


def _why(fit, best):
    """Why a set of causes was not chosen."""
    ratio = np.sqrt(fit.cost / best.cost)
    if fit.cost > _AS_WELL * best.cost:
        return f"leaves {ratio:.3g} times the error"
    if len(fit.unknowns) > len(best.unknowns):
        return "its further parameters gain what chance would, or nothing on held-out data"
    if len(fit.unknowns) < len(best.unknowns):
        return "leaves more than chance would"
    return "describes the record nearly as well"
