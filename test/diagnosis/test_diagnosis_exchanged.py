"""Reference and sensor that were exchanged are refused; hidden effects are not taken for that."""

import pytest
from rig.hidden import draw_case

from frac_accel import diagnose
from frac_accel.errors import FracAccelError

CAUSES = ["cubic_stiffness", "time_delay", "sensitivity_error", "fractional_damping"]


@pytest.mark.parametrize("seed", range(8))
def test_exchanged_topics_are_refused(seed):
    case = draw_case(1100 + seed, [CAUSES[seed % len(CAUSES)]])
    reference, sensor, _ = case.samples()
    with pytest.raises(FracAccelError, match="reference and sensor are exchanged"):
        diagnose((sensor, reference), case.model())
