"""Page of a fleet: what its bags say, and what they show together."""

import os

from . import figures
from .page import Page

_SHOWN = 500
_FALSE_DISCOVERIES = (
    "Each cause is tested in each group that the given columns make. Of all that is shown here, at "
    "most one per cent is expected to be wrong (Benjamini and Yekutieli). Effects are to first "
    "order beside the model in use; all other causes that may be behind them are listed.")


def fleet_page(seen, command=""):
    """Page of a fleet at a glance; its bags' own pages are linked to.

    Parameters
    ----------
    seen : Overview
        Plain data: see `frac_accel.fleet.overview`.
    command : str
    """
    page = Page(f"Fleet: {seen.verb} of {seen.bags} bags", {"command": command})
    glance = page.section("At a glance")
    glance.items(seen.words[:1] + [
        f"{seen.costs['cpu_s']:.4g} s of processor time, the largest worker had "
        f"{seen.costs['memory_mb']:.0f} MB"])
    if seen.causes:
        glance.table(["cause", "bags", "vehicles"], seen.causes,
                     "Causes that single bags name.")
    points = [entry for entry in seen.bag_list
              if entry["nrmse"] is not None and entry["start_ns"] is not None]
    if points:
        glance.figure(figures.by_date(points),
                      "Error of the model in use in each bag, over the standard deviation of its "
                      "output; a click on a point opens the bag's page, where there is one.")
    _together(page, seen)
    _bags(page, seen)
    if seen.failed:
        page.section("Bags that failed").table(
            ["bag", "error"], [[entry["bag"], entry["error"]] for entry in seen.failed[:_SHOWN]],
            f"{len(seen.failed)} in all.")
    return page


def _together(page, seen):
    section = page.section("What no single bag shows")
    section.text(_FALSE_DISCOVERIES)
    if seen.common:
        section.table(
            ["group", "cause", "vehicles with it", "elsewhere", "p"],
            [[e["group"], e["cause"], f"{e['vehicles']} of {e['of']}",
              f"{e['elsewhere']} of {e['of_elsewhere']}", f"{e['p_value']:.1g}"]
             for e in seen.common], "Causes that bags of a group name more often than others.")
    if seen.weak:
        section.table(
            ["group", "cause", "parameter", "mean", "95 % interval", "spread", "unit", "vehicles",
             "p", "may also be behind it"],
            [[e.group, e.cause, e.parameter, f"{e.pooled.mean:.4g}",
              f"{e.pooled.low:.4g} to {e.pooled.high:.4g}", f"{e.pooled.spread:.2g}", e.unit,
              e.pooled.count, f"{e.pooled.p_value:.1g}", e.rivals or "–"]
             for e in seen.weak],
            "Mean over vehicles of what each cause would be on its own, to first order.")
    if seen.odd:
        section.linked_table(
            ["vehicle", "cause", "parameter", "value", "std", "peers", "unit", "deviations"],
            [[(e["vehicle"], e["page"]), e["cause"], e["parameter"], f"{e['value']:.4g}",
              f"{e['std']:.2g}", f"{e['peers']:.3g}", e["unit"], f"{e['deviations']:.1f}"]
             for e in seen.odd[:_SHOWN]], "Vehicles that differ from their peers.")
    if not (seen.common or seen.weak or seen.odd):
        section.text("Nothing.")


def _bags(page, seen):
    rows = [[(os.path.basename(e["bag"]), e["page"]), e["vehicle"], e["axis"], e["verdict"] or "–",
             "–" if e["nrmse"] is None else f"{e['nrmse']:.2%}", ", ".join(e["causes"]) or "–"]
            for e in seen.bag_list]
    if rows:
        page.section("Bags").linked_table(
            ["bag", "vehicle", "axis", "verdict", "error", "causes"], rows,
            "The remarkable ones first" + (f"; {_SHOWN} of {seen.bags}."
                                           if seen.bags > len(rows) else "."))
