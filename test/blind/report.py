"""The suite's result as a page."""

from collections import Counter

import numpy as np
from rig.sensor import CAUSES, SECOND_SET, UNCATALOGUED

from . import score
from .plan import GROUPS, ON_ROADS

CATALOGUE = (*CAUSES, *SECOND_SET)
WITH_CAUSES = ("single", "multiple", "second_set", "road_single", "road_multiple")

# The likelihood-ratio test's: one false alarm in a hundred records, over all causes.
FALSE_ALARM = 0.01 / len(CAUSES)  # those of the power study


def markdown(rows, command):
    """Page from the rows of `trial.run`; parts that were not run are left out.

    command : what made the rows, for readers who want to make them again
    """
    sections = [_rates, _confusion, _parameters, _oracle, _power, _time]
    head = ["# Blind test of the diagnosis", "",
            f"Made by `{command}` from {len(rows)} diagnoses of records that an independent",
            "simulator (`test/rig`) made, with causes and parameters drawn at random: sensors of",
            "three kinds, three excitations, noise 40 to 80 dB below the signal, each effect at",
            "least three times the noise (`test/rig/hidden.py`). The diagnosis gets the sensor",
            "without its effects as the model in use. On the roads (`test/rig/road_cases.py`) flat",
            "sensors ride in cars, with noise on the reference, rates of their own, lost messages,",
            "spikes and a lattice around them; of these, what is truly there may be named too.",
            "Intervals are exact 95 % intervals of a proportion.", ""]
    return "\n".join(head + [line for section in sections for line in section(rows)])


def _table(head, lines):
    rows = [head, ["---"] * len(head), *lines]
    return ["| " + " | ".join(map(str, row)) + " |" for row in rows] + [""]


def _rates(rows):
    by = {group: score.of_group(rows, group) for group in GROUPS if group != "power"}
    judged = [row for group in by.values() for row in group]
    kept = [row for row in by["without_model"] if not set(row["causes"]) & score.ABSORBED]
    lines = [
        ("one cause: exactly it is named", [score.exact(r) for r in by["single"]]),
        ("two or three causes: exactly they are named", [score.exact(r) for r in by["multiple"]]),
        ("no cause: consistent", [score.consistent(r) for r in by["clean"]]),
        ("no cause: consistent or undecided, nothing named", [score.quiet(r) for r in by["clean"]]),
        ("no cause: false alarm", [bool(r["findings"]) for r in by["clean"]]),
        ("outside the catalogue: unexplained or undecided, no wrong name",
         [score.unexplained(r) for r in by["outside"]]),
        ("without a model, cause not taken in by the identified one: exactly it is named",
         [score.exact(r) for r in kept]),
        ("second set, one cause: exactly it is named", [score.exact(r) for r in by["second_set"]]),
        ("road, one cause: exactly it is named", [score.exact(r) for r in by["road_single"]]),
        ("road, two or three causes: exactly they are named",
         [score.exact(r) for r in by["road_multiple"]]),
        ("road, no cause: no wrong name", [score.right(r) for r in by["road_clean"]]),
        ("road, outside the catalogue: unexplained or undecided, no wrong name",
         [score.unexplained(r) for r in by["road_outside"]]),
        ("all of these: true parameter within 1.96 stated standard uncertainties",
         score.coverage(judged)),
        ("all of these: undecided", [r["verdict"] == "undecided" for r in judged]),
        ("all of these: some name is wrong", [bool(score.wrong(r)) for r in judged]),
        ("all of these: refused, insufficient or crashed",
         [r["error"] is not None or r["verdict"] == "insufficient_data" for r in judged]),
    ]
    table = _table(["", "share (count; 95 % interval)"],
                   [(words, score.share(flags)) for words, flags in lines if flags])
    errors = Counter(row["error"] for row in rows if row["error"])
    return ["## Verdicts", "", *table,
            *(f"- {count} × {words}" for words, count in errors.most_common()),
            *([""] if errors else [])]


def _confusion(rows):
    lines = []
    for group in ("single", "second_set", "outside", "clean", "multiple", *ON_ROADS):
        of = score.of_group(rows, group)
        road = "road: " if group in ON_ROADS else ""
        if group.endswith("multiple"):
            # by what was missed and what was added, since hardly two sets are alike
            missed = Counter(c for r in of for c in set(r["causes"]) - score.named(r))
            added = Counter(c for r in of for c in score.wrong(r))
            if of:
                lines += [(f"{road}several: missed", len(of), "", _counts(missed)),
                          (f"{road}several: added", len(of), "", _counts(added))]
            continue
        table = score.confusion(of)
        for cause in (*CATALOGUE, *UNCATALOGUED, "none"):
            if cause in table:
                mine = [r for r in of if ("+".join(r["causes"]) or "none") == cause]
                other = table[cause].copy()
                hits = other.pop(cause, 0)
                lines.append((f"{road}`{cause}`", len(mine), hits if cause in CATALOGUE else "",
                              _counts(other)))
    if not lines:
        return []
    return ["## Hidden and named", "", "What is named is `nothing`, `error` or a cause.", "",
            *_table(["hidden", "runs", "named", "named besides or instead"], lines)]


def _counts(counter):
    return ", ".join(f"{name} ×{count}" for name, count in counter.most_common())


def _parameters(rows):
    found = score.parameter_errors([row for row in rows if row["group"] in WITH_CAUSES])
    if not found:
        return []
    lines = [(f"`{cause}`", f"`{name}`", *entry[:3], entry.without_std or "")
             for (cause, name), entry in sorted(found.items(),
                                                key=lambda item: CATALOGUE.index(item[0][0]))]
    return ["## Parameters of the causes that were named", "",
            "The departure is the difference from the value that means no effect.", "",
            *_table(["cause", "parameter", "within 10 % of the value", "of the departure",
                     "in the 95 % interval", "no uncertainty"], lines)]


def _oracle(rows):
    judged = score.of_group(rows, "single") + score.of_group(rows, "multiple")
    ratios = score.error_over_oracle(judged)
    shares, errors = score.correction_share(judged)
    if not len(ratios):
        return []
    lines = [("held-out error over that of the true sensor", len(ratios), *_quantiles(ratios))]
    if len(shares):
        lines.append(("correction: share of the true inverse's gain in power", len(shares),
                      *_quantiles(shares)))
    return ["## Against the true sensor", "",
            "The oracle is the true sensor with its true parameters.", "",
            *_table(["", "runs", "10 %", "median", "90 %"], lines),
            *(f"- correction not measured, {count} × {words}" for words, count in
              errors.most_common(5)), ""]


def _quantiles(values):
    return [f"{value:.4g}" for value in np.quantile(values, (0.1, 0.5, 0.9))]


def _power(rows):
    of = score.of_group(rows, "power")
    lines = []
    for cause in CAUSES:
        mine = [row for row in of if row["causes"][0] == cause]
        if mine:
            p = score.power(mine, FALSE_ALARM)
            inside = p.smallest < p.found_in_90_percent < p.largest
            threshold = (f"{p.found_in_90_percent:.3g}" if inside
                         else f"below {p.smallest:.3g}" if p.found_in_90_percent <= p.smallest
                         else f"above {p.largest:.3g}")
            lines.append((f"`{cause}`", threshold,
                          "-" if np.isnan(p.limit) else f"{p.limit:.3g}",
                          f"{p.smallest:.3g} to {p.largest:.3g}", p.found))
    if not lines:
        return []
    return ["## Power", "",
            "RMS of the effect over that of the noise. The limit is that of the likelihood-ratio",
            "test that knows the cause and everything else about the sensor, with one false alarm",
            "in a hundred records over all causes.", "",
            *_table(["cause", "found in 90 %", "limit", "tried", "found"], lines)]


def _time(rows):
    seconds = np.array([row["cpu_s"] for row in rows])
    samples = np.array([row["samples"] for row in rows])
    return ["## Time", "",
            f"CPU time of a diagnosis: median {np.median(seconds):.2f} s, 95 % "
            f"{np.quantile(seconds, 0.95):.2f} s, largest {seconds.max():.2f} s, for "
            f"{np.median(samples):.0f} samples (median).", ""]
