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
    assert "depends on the reference" in result.validation.verdict[0]


def test_a_shock_can_be_described_in_z():
    """Its end is quieter and slower than its beginning, and no measure of the beginning's model."""
    result, validation = real_records.figures("shock_ptb", "arx")
    _, seismic = real_records.figures("shock_ptb")
    assert result.structure == "arx"
    assert validation.simulation.total.nrmse < seismic.simulation.total.nrmse


def test_sweep_is_corrected_over_its_band_by_the_structure_that_auto_chooses():
    result, validation = real_records.figures("mems_package_sweep", "auto")
    assert result.structure == "arx" and "clearly better" in result.reason
    assert validation.comparison.corrected.total.band_hz[1] > 30.0
    assert validation.comparison.corrected.total.nrmse < 0.02


@pytest.mark.parametrize("name", real_records.RECORDS)
def test_correction_brings_the_sensor_closer(name):
    _, validation = real_records.figures(name)
    assert validation.comparison.corrected.total.nrmse < validation.comparison.scaled.total.nrmse


def test_readme_shows_these_figures():
    shown = readme_examples.RECORDS.search(readme_examples.RECORDS_PAGE.read_text("utf-8"))[2]
    assert readme_examples.same(shown, real_records.table())
