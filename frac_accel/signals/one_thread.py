"""One thread for linear algebra, as all its problems here are small."""

import os


def prefer():
    """Keep the linear algebra library from starting threads; call before numpy is imported.

    Threads on a busy machine make the design of a filter take seconds instead of milliseconds, and
    their number changes how results are rounded: node and command must agree to the last bit.
    """
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
