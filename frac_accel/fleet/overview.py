"""A fleet at a glance, from its rows: what single bags say, and what they show together."""

import collections
import dataclasses

import numpy as np

from ..shown import several
from .estimates import Estimates
from .groups import groups_of
from .peers import common_causes, odd_vehicles
from .plan import VEHICLE
from .weak_effects import weak_effects

# Most bags that are listed one by one.
_MOST_LISTED = 500
_UNREMARKABLE = ("consistent", "insufficient_data", None)


@dataclasses.dataclass(frozen=True)
class Overview:
    """What a fleet shows.

    Attributes
    ----------
    verb : str
    bags, vehicles : int
    verdicts : dict of str to int
    causes : list of tuple
        (cause, bags that name it, vehicles), the most frequent first.
    common : list of dict
        As `common_causes`.
    weak : list of WeakEffect
    odd : list of dict
        As `odd_vehicles`, with ``bag`` and ``page`` of one of the vehicle's bags.
    failed : list of dict
        ``bag`` and ``error``.
    bag_list : list of dict
        ``bag``, ``page``, ``vehicle``, ``axis``, ``start_ns``, ``nrmse``, ``verdict``, ``causes``;
        the remarkable ones first.
    costs : dict of str to float
        ``cpu_s``, ``wall_s`` of all bags, ``memory_mb`` of the largest worker.
    """

    verb: str
    bags: int
    vehicles: int
    verdicts: dict
    causes: list
    common: list
    weak: list
    odd: list
    failed: list
    bag_list: list
    costs: dict

    @property
    def words(self):
        """The same in lines of text."""
        lines = [f"{several(self.bags, 'row')} of {several(self.vehicles, 'vehicle')}: "
                 + ", ".join(f"{count} {name}" for name, count in self.verdicts.items())]
        lines += [f"  {cause}: named in {bags} bags of {vehicles} vehicles"
                  for cause, bags, vehicles in self.causes]
        lines += [f"common: {entry['cause']} in {entry['vehicles']} of {entry['of']} vehicles with "
                  f"{entry['group']}, in {entry['elsewhere']} of {entry['of_elsewhere']} others"
                  for entry in self.common]
        lines += [f"together: {weak_words(effect)}" for effect in self.weak]
        lines += [f"odd: {odd_words(entry)}" for entry in self.odd[:20]]
        lines += [f"error: {entry['bag']}: {entry['error'].removeprefix(entry['bag'] + ': ')}"
                  for entry in self.failed[:20]]
        if len(self.failed) > 20:
            lines.append(f"and {len(self.failed) - 20} more bags with an error")
        return lines


def weak_words(effect):
    """A weak effect in a line."""
    p = effect.pooled
    name = f"{effect.cause} {effect.parameter}".strip()
    rivals = f"; {effect.rivals}" if effect.rivals else ""
    return (f"{effect.group}: {name} {p.mean:.4g} {_unit(effect.unit)}({p.low:.4g} to {p.high:.4g},"
            f" spread {p.spread:.2g}, {p.count} vehicles, p = {p.p_value:.1g}){rivals}")


def odd_words(entry):
    """An odd vehicle in a line."""
    name = f"{entry['cause']} {entry['parameter']}".strip()
    return (f"{entry['vehicle']}: {name} {entry['value']:.4g} ± {entry['std']:.2g} "
            f"{_unit(entry['unit'])}where its peers have {entry['peers']:.3g}: "
            f"{entry['deviations']:.1f} standard deviations")


def _unit(unit):
    return f"{unit} " if unit and unit != "1" else ""


def overview(table, given, jobs):
    """`Overview` of rows.

    Parameters
    ----------
    table : pyarrow.Table
    given : list of str
        Columns that somebody has added.
    jobs : set of str
        Those whose rows count.
    """
    rows = [row for row in table.to_pylist() if row["job"] in jobs]
    good = [row for row in rows if not row["error"]]
    owners = [row.get(VEHICLE) or row["bag"] for row in good]
    causes = collections.Counter(cause for row in good for cause in set(row["causes"] or ()))
    having = {cause: {owner for row, owner in zip(good, owners) if cause in (row["causes"] or ())}
              for cause in causes}
    common, weak, odd = _together(good, owners, given)
    return Overview(
        rows[0]["verb"] if rows else "", len(rows), len(set(owners)),
        dict(collections.Counter("failed" if row["error"] else row["verdict"] or "done"
                                 for row in rows).most_common()),
        [(cause, count, len(having[cause])) for cause, count in causes.most_common()],
        common, weak, odd,
        [{"bag": row["bag"], "error": row["error"]} for row in rows if row["error"]],
        _listed(good, owners),
        {"cpu_s": sum(row["cpu_s"] or 0 for row in rows),
         "wall_s": sum(row["wall_s"] or 0 for row in rows),
         "memory_mb": max((row["memory_mb"] or 0 for row in rows), default=0.0)})


def _together(rows, owners, given):
    """What vehicles show together, each axis by itself; the axis stands with the group."""
    common, weak, odd = [], [], []
    axes = sorted({row["axis"] for row in rows})
    for axis in axes:
        mine = [i for i, row in enumerate(rows) if row["axis"] == axis and row["verdict"]]
        if not mine:
            continue
        vehicles = list(dict.fromkeys(owners[i] for i in mine))
        first = {owners[i]: rows[i] for i in reversed(mine)}
        columns = {name: [first[vehicle][name] or "" for vehicle in vehicles]
                   for name in given if name != VEHICLE}
        groups = groups_of(columns, len(vehicles))
        if len(axes) > 1:
            groups = {f"{name}, axis {axis}": has for name, has in groups.items()}
        named = {vehicle: set() for vehicle in vehicles}
        for i in mine:
            named[owners[i]] |= set(rows[i]["causes"] or ())
        common += common_causes(list(named.values()), groups)
        screened = [i for i in mine if rows[i]["estimates"]]
        if screened:
            estimates = Estimates.of([rows[i] for i in screened])
            own, estimates = estimates.by_owner([owners[i] for i in screened])
            place = {vehicle: number for number, vehicle in enumerate(vehicles)}
            kept = np.array([place[vehicle] for vehicle in own])
            effects, rest = weak_effects(estimates, {name: has[kept]
                                                     for name, has in groups.items()})
            weak += effects
            odd += [{**entry, "bag": first[entry["vehicle"]]["bag"],
                     "page": first[entry["vehicle"]]["page"]}
                    for entry in odd_vehicles(rest, own)]
    return common, weak, odd


def _listed(rows, owners):
    entries = [{"bag": row["bag"], "page": row["page"], "vehicle": owner, "axis": row["axis"],
                "start_ns": row["start_ns"], "verdict": row["verdict"],
                "nrmse": row["nrmse"] if row["baseline_nrmse"] is None else row["baseline_nrmse"],
                "causes": row["causes"] or []} for row, owner in zip(rows, owners)]
    entries.sort(key=lambda entry: (entry["verdict"] in _UNREMARKABLE, -(entry["nrmse"] or 0.0)))
    return entries[:_MOST_LISTED]
