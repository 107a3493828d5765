"""Which tests `make check` runs."""

import pytest

# Files whose tests catch most for their time: a minute on two cores.
FAST = """
    bag_hostile bag_roundtrip cdr commands core_response diagnosis_thresholds domains_agree
    effects_invert health linear_filter live_messages live_metrics metrics model_file report_figures
    report_page timing z_and_s
""".split()


def pytest_collection_modifyitems(items):
    """Mark them, but not what is long or needs ROS, the real records or an installed package."""
    for item in items:
        if item.path.stem.removeprefix("test_") in FAST \
                and not any(map(item.get_closest_marker, ("long", "ros", "real_data"))):
            item.add_marker(pytest.mark.fast)
