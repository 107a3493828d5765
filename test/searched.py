"""A diagnosis together with the search behind it, for tests of the search itself."""

from unittest import mock

from frac_accel import diagnose
from frac_accel.diagnosis import verdict


def searched(case, **options):
    """Diagnosis of a case, its Engine and its best fit."""
    reference, sensor, celsius = case.samples()
    with mock.patch.object(verdict.Evidence, "of", wraps=verdict.Evidence.of) as made:
        found = diagnose((reference, sensor), **{"model": case.model(), "temperature": celsius,
                                                 **options})
    engine, best, _, _ = made.call_args.args
    return found, engine, best
