"""First-order estimates of every cause in every vehicle: from bags to vehicles, and beside others.

Every bag of a screened diagnosis tells what each cause would be on its own, with its uncertainty
and with the correlations of the causes' effects.
"""

import dataclasses

import numpy as np

# Share of an effect's power beside others from which on it has an estimate of its own.
_OWN = 0.01
# Directions of effects that are left out as one and the same, as a share of the strongest.
_SAME = 1e-5


@dataclasses.dataclass(frozen=True, eq=False)
class Estimates:
    """First-order estimates of some owners: bags, or vehicles.

    Attributes
    ----------
    names : list of (str, str)
        Cause and parameter.
    units : list of str
    values, stds, sizes : ndarray, shape (n, p)
        NaN where an owner has none; `sizes` are RMS effects of one unit [output units].
    correlations : ndarray, shape (n, p, p)
        Of the effects on the output; NaN where there is none.
    """

    names: list
    units: list
    values: np.ndarray
    stds: np.ndarray
    sizes: np.ndarray
    correlations: np.ndarray

    @classmethod
    def of(cls, screened):
        """Of what `Diagnosis.screened` says of each bag."""
        units = {}
        for one in screened:
            units.update({(e["cause"], e["parameter"]): e["unit"] for e in one["estimates"]})
        names = sorted(units)
        place = {name: i for i, name in enumerate(names)}
        shape = len(screened), len(names)
        values, stds, sizes = np.full((3, *shape), np.nan)
        correlations = np.full((*shape, len(names)), np.nan, np.float32)
        for i, one in enumerate(screened):
            own = [place[e["cause"], e["parameter"]] for e in one["estimates"]]
            for array, key in ((values, "value"), (stds, "std"), (sizes, "size")):
                array[i, own] = [e[key] for e in one["estimates"]]
            upper = np.triu_indices(len(own), 1)
            block = np.eye(len(own))
            block[upper] = one["correlations"]
            block.T[upper] = block[upper]
            correlations[i][np.ix_(own, own)] = block
        return cls(names, [units[name] for name in names], values, stds, sizes, correlations)

    def by_owner(self, owners):
        """The same of owners who have several bags each, and who they are."""
        first = list(dict.fromkeys(owners))
        owners = np.array(owners, object)
        parts = [self._mean(np.flatnonzero(owners == owner)) for owner in first]
        return first, dataclasses.replace(self, **{
            name: np.array([part[name] for part in parts]) for name in parts[0]})

    def _mean(self, rows):
        """Of one owner's bags: as of one fit to all of them.

        A bag counts by its effects' power in its own noise, which is one figure a bag, so that
        what an effect adds to the estimates of others is what their summed products say.
        """
        values, sizes, known = self.values[rows], self.sizes[rows], self.stds[rows] > 0
        with np.errstate(invalid="ignore", divide="ignore"):
            noise = [np.median((std * size)[own]) if own.any() else np.inf
                     for std, size, own in zip(self.stds[rows], sizes, known)]
            scaled = np.where(known, sizes / np.array(noise)[:, None], 0.0)
            weight = scaled**2
            total = weight.sum(axis=0)
            mean = np.sum(weight * np.nan_to_num(values), axis=0) / total
            own_std = np.sqrt(np.sum((weight * np.nan_to_num(self.stds[rows]))**2, axis=0)) / total
            # bags that scatter more than they say make their mean less certain
            scatter = np.sum(np.nan_to_num((values - mean) / self.stds[rows])**2, axis=0)
            freedom = np.maximum(known.sum(axis=0) - 1, 1)
            shared = np.einsum("ij,ik,ijk->jk", scaled, scaled,
                               np.nan_to_num(self.correlations[rows]))
            return {"values": mean, "stds": own_std * np.sqrt(np.maximum(scatter / freedom, 1.0)),
                    "sizes": np.where(total > 0, np.sqrt(total), np.nan),
                    "correlations": shared / np.sqrt(np.outer(total, total))}

    def beside(self, rows, causes):
        """The same where some owners' estimates are made together with some causes.

        Whatever these causes add to an owner's output, and however much it differs from owner to
        owner, moves none of the others' estimates then (W. H. Greene, *Econometric Analysis*, on
        partitioned regression). What they can do nearly as well has no estimate.
        """
        names = "values", "stds", "sizes", "correlations"
        arrays = {name: getattr(self, name).copy() for name in names}
        for name, part in zip(names, _partial(*(array[rows] for array in arrays.values()), causes)):
            arrays[name][rows] = part
        return dataclasses.replace(self, **arrays)

    def without(self, rows, cause, mean):
        """The same after an effect of some owners has been taken out of all their estimates.

        What one unit of it adds to another cause's own estimate is the correlation of the two
        effects times the ratio of their sizes.
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            share = (self.correlations[rows, :, cause] * self.sizes[rows, cause][:, None]
                     / self.sizes[rows])
        values = self.values.copy()
        values[rows] -= mean * np.nan_to_num(share)
        return dataclasses.replace(self, values=values)


def _partial(values, stds, sizes, correlations, causes):
    """Values, stds, sizes and correlations of owners beside some causes (indices)."""
    causes = np.asarray(causes, int)
    products = np.nan_to_num(correlations.astype(float))
    # what an owner lacks is a zero, which the pseudo-inverse leaves out
    inverse = np.linalg.pinv(products[:, causes[:, None], causes], _SAME, hermitian=True)
    share = inverse @ products[:, causes]
    left = products - products[:, :, causes] @ share
    own = np.diagonal(left, axis1=1, axis2=2)
    root = np.sqrt(np.where(np.isfinite(values) & (own > _OWN), own, np.nan))
    effects = values * sizes
    taken = np.einsum("ik,ikj->ij", np.nan_to_num(effects[:, causes]), share)
    return ((effects - taken) / sizes / root**2, stds / root, sizes * root,
            left / (root[:, :, None] * root[:, None, :]))
