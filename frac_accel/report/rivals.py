"""Which other sets of causes were fitted, and why they lost."""

# Errors over the chosen set's up to which a set describes the record as well.
_AS_WELL = 1.01


def rivals(section, found):
    """Fill a section with the sets of causes that were fitted, the best ones first."""
    seen = found.evidence
    chosen = "fits best, but is not sure: see above" if found.suspects else "chosen"
    best = next(rival for rival in seen.rivals if rival.chosen)
    rows = [[" + ".join(rival.causes) or "(the model in use)", str(rival.parameters),
             f"{rival.rmse:.4g}", "–" if rival.chosen else f"{rival.behind:.3g}",
             chosen if rival.chosen else _why(rival, best)] for rival in seen.rivals]
    section.table(
        ["causes", "parameters", "RMSE", "fits worse by [σ²]", "why not"], rows,
        f"The sets of causes that fit the whole record best, of {seen.fitted_sets} that were "
        "fitted; sets that fell far behind were not fitted to the end. Fits worse by: in variances "
        "σ² of the noise, with a penalty for each parameter; less than 10 does not tell two sets "
        "apart."
        + (f" In every set: {', '.join(seen.always)}, within what the model in use leaves open."
           if seen.always else ""))


def _why(rival, best):
    """Why a set of causes was not chosen."""
    if rival.rmse > _AS_WELL * best.rmse:
        return f"leaves {rival.rmse / best.rmse:.3g} times the error"
    if rival.parameters > best.parameters:
        return "its further parameters gain no more than chance, or nothing on held-out data"
    if rival.parameters < best.parameters:
        return "leaves more than chance would"
    return "fits the record nearly as well"
