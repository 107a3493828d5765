"""`frac_accel paper`: its files have their fixed form, its page is complete, bad input is told."""

import json

import paper_study_sample
import pytest

from frac_accel.cli import main
from frac_accel.paper import PaperResult, reproduce
from frac_accel.report.paper import paper_page

BAGS = paper_study_sample.bags_of(None)["one_sine"][0].parent
TABLE = {"frequency_hz", "fractional_error_percent", "difference_percent"}
CLAIM = {"claim": str, "status": str, "cause": str, "evidence": str}


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """Result file, page and printed text of the quick part."""
    folder = tmp_path_factory.mktemp("paper")
    assert main(["paper", "--quick", "--json", str(folder / "r.json"), "--report",
                 str(folder / "r.html")]) == 0
    return json.loads((folder / "r.json").read_text()), (folder / "r.html").read_text()


def test_result_file_has_its_form(quick):
    result, _ = quick
    for number in ("2", "3"):
        table = result["tables"][number]
        assert set(table) >= TABLE
        assert table["frequency_hz"] == [100, 200, 300, 400, 500]
        assert all(abs(value - 20.804) < 5e-4 for value in table["fractional_error_percent"])
        assert len(table["difference_percent"]) == 5
    assert result["tables"]["2"]["difference_percent"][0] == pytest.approx(10.0049, abs=1e-4)
    assert result["tables"]["3"]["difference_percent"][4] == pytest.approx(69.7586, abs=1e-4)
    assert set(result["tables"]) == {"1", "2", "3", "4"}
    assert len(result["claims"]) >= 25
    for claim in result["claims"]:
        assert all(isinstance(claim[key], kind) and claim[key] for key, kind in CLAIM.items())
    assert set(result["figures"]) == {"3", *map(str, range(8, 18))}
    assert result["domain_correct"]["error_percent"][2] > 200
    assert result["study"] is None


def test_quick_page_tells_every_claim(quick):
    result, page = quick
    assert "Where 20.804 % comes from" in page and "The map: when" not in page
    for claim in result["claims"]:
        assert claim["where"] in page or claim["where"].capitalize() in page


def test_full_result_can_be_written(tmp_path):
    study = paper_study_sample.sample_study(BAGS)
    quick = reproduce(study=False)
    result = PaperResult(quick.tables, quick.figures, quick.claims, study)
    told = json.loads(json.dumps(result.as_dict(), allow_nan=True))["study"]
    assert len(told["answer"]) == 5
    assert len(told["map"]) == len(study.cells)
    causes = {finding["cause"]: finding for finding in told["diagnoses"]["lagging"]["findings"]}
    corner = causes["low_pass_lag"]["parameters"]["corner_hz"]
    assert corner["value"] == pytest.approx(2500, abs=4 * corner["std"])
    assert "fractional_damping" not in causes
    fractional = told["bench"]["fractional"]["models"]["fractional"]
    assert fractional["values"]["damping_order"] == pytest.approx(0.6, abs=0.01)
    assert len(fractional["amplitude_error_percent"]) == 10
    paper_page(result, {"command": "test"}).write(tmp_path / "r.html")
    page = (tmp_path / "r.html").read_text()
    for heading in ("Held-out errors on the bench", "Orders swept and optimised", "The map"):
        assert heading in page
    assert any("map of" in line for line in study.words())


def test_missing_bags_are_one_line(tmp_path, capsys):
    assert main(["paper", "--bags", str(tmp_path)]) == 2
    error = capsys.readouterr().err.strip()
    assert "no such bag" in error and "--quick" in error and "\n" not in error


def test_output_without_folder_is_refused_before_the_work(tmp_path, capsys):
    assert main(["paper", "--json", str(tmp_path / "no" / "r.json")]) == 2
    assert "does not exist" in capsys.readouterr().err
