"""Identification and correction of the real records, as docs/real_records.md shows them."""

from pathlib import Path

from frac_accel import identify, read_bag
from frac_accel.io.bag import RAW_TOPIC, REFERENCE_TOPIC
from frac_accel.validation import validate

FOLDER = Path(__file__).resolve().parents[2] / "shared" / "data"
RECORDS = ("shock_ptb", "mems_package_sweep", "shaking_table_earthquake-test1",
           "shaking_table_earthquake-test5", "shaking_table_earthquake-test9")


def figures(name, structure="oscillator"):
    """Identification of one record, and the validation of its model."""
    bag = FOLDER / f"{name}.mcap"
    topics = read_bag(bag, [REFERENCE_TOPIC, RAW_TOPIC])
    result = identify(bag, structure=structure)
    return result, validate((topics[REFERENCE_TOPIC], topics[RAW_TOPIC]), result.model)


def table():
    """Markdown table of all records."""
    lines = ["| record | sensitivity | band [Hz] | model's residual | raw / sensitivity: NRMSE | "
             "corrected: NRMSE |", "|---|---|---|---|---|---|"]
    for name in RECORDS:
        result, validation = figures(name)
        gain = result.parameters["sensitivity"]
        before, after = validation.comparison.scaled.total, validation.comparison.corrected.total
        lines.append(
            f"| `{name}` | {gain['value']:.5f} ± {gain['std']:.1g} | {after.band_hz[0]:.3g} to "
            f"{after.band_hz[1]:.4g} | {100 * result.nrmse:.2f} % | {100 * before.nrmse:.2f} % | "
            f"{100 * after.nrmse:.2f} % |")
    return "\n".join(lines) + "\n"
