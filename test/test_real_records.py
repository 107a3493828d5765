"""Real measurements: what identify and correct make of them."""

import pytest
import readme_examples
import real_records

pytestmark = [pytest.mark.real_data, pytest.mark.skipif(
    not real_records.FOLDER.is_dir(), reason="the records in ../shared/data are not here")]


def test_shock_sensitivity_agrees_with_the_sinusoidal_calibration():
    """0.22708 pC/(m/s^2) at 500 Hz, by another method and laboratory procedure."""
    result, _ = real_records.figures("shock_ptb")
    assert result.parameters["sensitivity"]["value"] == pytest.approx(0.22708, rel=2e-3)
    assert any("something real is missing" in note for note in result.notes)


@pytest.mark.parametrize("name", real_records.RECORDS)
def test_correction_brings_the_sensor_closer(name):
    _, validation = real_records.figures(name)
    assert validation.comparison.corrected.total.nrmse < validation.comparison.scaled.total.nrmse


def test_readme_shows_these_figures():
    shown = readme_examples.RECORDS.search(readme_examples.README.read_text("utf-8"))[2]
    assert readme_examples.same(shown, real_records.table())
