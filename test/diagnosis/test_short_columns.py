"""Columns that are kept by the rows and blocks in which there is anything of them."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from frac_accel.diagnosis.short_columns import ShortColumns


def test_blocks_are_what_dense_columns_would_be():
    rng = np.random.default_rng(1)
    parts = []
    for length, rows, count in ((30, 10, 2), (20, 0, 0), (40, 25, 3)):
        columns = np.zeros((length, count))
        columns[2:2 + rows] = rng.normal(size=(rows, count))
        parts.append(ShortColumns.of(columns))
    short, used = ShortColumns.in_turn(parts), rng.random(90) > 0.2
    whole = short.whole()
    assert whole.shape == (90, 5)
    assert short.count == 5
    values, shares = rng.normal(size=(90, 2)), rng.normal(size=(5, 2))
    assert short.products(values) == pytest.approx(whole.T @ values)
    assert short.add_to(values.copy(), shares) == pytest.approx(values + whole @ shares)

    free, back = short.orthonormal(used)
    basis = free.whole()
    assert not basis[~used].any()
    assert basis.T @ basis == pytest.approx(np.eye(5))
    # the components of what the columns make are these columns' shares again
    made = (whole @ shares) * used[:, None]
    assert back @ free.products(made) == pytest.approx(shares)


def test_a_column_that_others_make_is_left_out():
    column = np.r_[np.exp(-np.arange(10.0)), np.zeros(10)]
    free, back = ShortColumns.of(np.c_[column, 2 * column]).orthonormal(np.ones(20, bool))
    assert free.count == 1
    assert back.shape == (2, 1)


def test_nothing_is_added_where_no_sample_counts():
    free, back = ShortColumns.of(np.eye(4)[:, :2]).orthonormal(np.zeros(4, bool))
    values = np.ones(4)
    assert free.count == 0
    assert back.shape == (2, 0)
    assert np.array_equal(free.add_to(values, free.products(values)), np.ones(4))


def test_a_bounded_column_takes_no_more_and_the_others_what_is_left():
    rng = np.random.default_rng(7)
    parts = [ShortColumns.of(rng.normal(size=(40, 3)), np.array([np.inf, 0.01, 5.0])),
             ShortColumns.of(rng.normal(size=(0, 1)), np.array([1.0])),
             ShortColumns.of(rng.normal(size=(30, 2)), np.array([0.02, np.inf]))]
    short, used = ShortColumns.in_turn(parts), rng.random(70) > 0.2
    values, level = rng.normal(size=70) * used, 3.0
    shares, free = short.describing(values, used, level)
    dense, most = short.whole() * used[:, None], level * short.most
    known = lsq_linear(dense, values, (-most, most), method="bvls", tol=1e-14).x
    assert shares == pytest.approx(known, abs=1e-9)
    assert free.count == 5 - np.sum(np.abs(shares) > most - 1e-9)
    # what is not held has taken all that it can
    assert free.products(values - dense @ shares) == pytest.approx(0, abs=1e-9)
