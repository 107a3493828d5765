"""When a change began, with an interval: of one that came at once, or grew."""

import dataclasses
from typing import NamedTuple

import numpy as np

# Blocks that must lie on either side of an onset.
_SIDE = 4
_COVERAGE = 0.95
# Blocks that are looked at one by one: the last of them, or as many of several each.
_MOST = 1000
# Share of the healthy noise's variance that a change may take away, and steps to its size.
_QUIETEST, _STEPS = 0.99, 12
# Median of the square of a standard normal variable.
_MEDIAN = 0.455


class Onset(NamedTuple):
    """Beginning of a change.

    Attributes
    ----------
    ns, low_ns, high_ns : int
        Stamp at which it began, and its 95 % interval.
    is_gradual : bool
        Whether a growing change describes the residual better than a sudden one.
    """

    ns: int
    low_ns: int
    high_ns: int
    is_gradual: bool


def onset(blocks, learnt):
    r"""Posterior of the instant at which a residual has changed, all instants being as likely.

    Before it, the residual is what was learnt. After it, each direction has a share of its own, and
    the noise a size of its own (sudden); or the shares and the noise's standard deviation grow with
    time (gradual). Both have the same number of parameters, which are profiled. All logarithms of
    likelihoods are divided by the factor by which the healthy residual's sums scatter more than
    those of white noise, so that correlated samples do not count as independent ones.

    Parameters
    ----------
    blocks : Blocks
        From before the change until now.
    learnt : Learnt

    Returns
    -------
    Onset
    """
    blocks = dataclasses.replace(blocks, power=np.maximum(learnt.left(blocks), 1e-300),
                                 shared=blocks.shared - blocks.gram @ learnt.mean)
    blocks = blocks.about_one_centre()
    found, is_early = _posterior(blocks.part(slice(-_MOST, None)), learnt)
    if is_early and len(blocks.power) > _MOST:
        found, _ = _posterior(blocks.merged(-(-len(blocks.power) // _MOST)), learnt)
    return found


def _posterior(blocks, learnt):
    """Onset in some blocks, and whether it may lie before them."""
    place = np.arange(len(blocks.power))
    places = place[_SIDE:-_SIDE]
    since = place - places[:, None]
    both = [_changed(blocks, learnt, course) for course in
            ((since >= 0).astype(float), np.maximum(since + 0.5, 0.0))]
    likelihoods = np.array([likelihood for likelihood, _ in both])
    kind, best = np.unravel_index(np.argmax(likelihoods), likelihoods.shape)
    likelihoods /= max(float(np.max(learnt.inflation)), both[kind][1][best])
    weight = np.exp(likelihoods - likelihoods.max())
    is_gradual = bool(weight[1].sum() > weight[0].sum())
    share = np.cumsum(weight.sum(axis=0)) / weight.sum()
    low, middle, high = (int(places[min(np.searchsorted(share, level), len(places) - 1)])
                         for level in ((1 - _COVERAGE) / 2, 0.5, (1 + _COVERAGE) / 2))
    step = int(np.median(np.diff(blocks.start_ns)))
    # it began within a block, or just before it
    return Onset(int(blocks.start_ns[middle]), int(blocks.start_ns[low] - step),
                 int(blocks.start_ns[high] + step), is_gradual), low == places[0]


def _changed(blocks, learnt, course):
    """Logarithms of the likelihoods of changes with some courses, and the scatter after them.

    The residual's share along each direction is proportional to the course, and the noise's
    variance the healthy one and a part that is proportional to its square.

    Parameters
    ----------
    blocks : Blocks
        Without the model's own error.
    learnt : Learnt
    course : ndarray, shape (m, k)

    Returns
    -------
    likelihood : ndarray, shape (m,)
    scatter : ndarray, shape (m,)
        How much more the blocks' powers scatter after the change than those of white noise.
    """
    shared, power, n = blocks.shared, blocks.power, blocks.count
    gram, own = blocks.gram.reshape(len(power), -1), course**2
    shares = _shares((own @ gram).reshape(-1, *blocks.gram.shape[1:]), course @ shared)
    squares = (shares[:, :, None] * shares[:, None, :]).reshape(len(course), -1)
    rest = np.maximum(power - 2 * course * (shares @ shared.T) + own * (squares @ gram.T),
                      1e-12 * power)
    least = -_QUIETEST * learnt.variance / own.max(axis=1, keepdims=True)
    grown = np.zeros_like(least)
    for _ in range(_STEPS):  # scoring, by which the likelihood of the noise's size is largest
        noise = learnt.variance + grown * own
        score = np.sum(own * (rest - n * noise) / noise**2, axis=1, keepdims=True)
        information = np.sum(n * (own / noise)**2, axis=1, keepdims=True)
        grown = np.maximum(grown + score / np.maximum(information, 1e-300), least)
    noise = learnt.variance + grown * own
    likelihood = -0.5 * (np.log(noise) @ n + np.sum(rest / noise, axis=1))
    apart = (rest - n * noise)**2 / (2 * np.maximum(n, 1.0) * noise**2)
    return likelihood, np.nanmedian(np.where(own > 0, apart, np.nan), axis=1) / _MEDIAN


def _shares(gram, right):
    """Least squares' coefficients, for each of many normal equations, shape (k, p)."""
    size = np.sqrt(np.maximum(np.diagonal(gram, axis1=1, axis2=2), 1e-300))
    scaled = gram / (size[:, :, None] * size[:, None, :])
    scaled = scaled + 1e-9 * np.eye(gram.shape[1])
    return np.linalg.solve(scaled, (right / size)[..., None])[..., 0] / size
