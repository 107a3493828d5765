"""Which tests `make check` runs."""

import pytest

# Files whose tests catch most for their time, and what takes long in them.
FAST = """
    bag_hostile bag_roundtrip cdr commands core_response diagnosis_thresholds effect_checks
    effects_invert health linear_filter live_messages live_metrics metrics model_file public_api
    report_figures report_page timing z_and_s
""".split()
SLOW = """
    test_memory_does_not_grow_with_the_bag test_only_the_asked_for_verb_is_loaded
    test_plug_in_of_the_documentation_as_a_third_party_installs_it test_walk_through_of_contributing
    test_the_package_can_be_imported_before_and_after test_random_damage_raises_bag_errors_only
""".split()


def pytest_collection_modifyitems(items):
    """Mark them, but nothing that is long or needs ROS or the real records."""
    for item in items:
        if item.path.stem.removeprefix("test_") in FAST and item.originalname not in SLOW \
                and not any(map(item.get_closest_marker, ("long", "ros", "real_data"))):
            item.add_marker(pytest.mark.fast)
