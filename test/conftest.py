"""Which tests `make check`, `make test`, `make test-all` and `colcon test` run."""

import pytest

# Files whose tests catch most for their time, and what takes long in them.
FAST = """
    bag_hostile bag_roundtrip cdr commands core_response diagnosis_thresholds effect_checks
    effects_invert health linear_filter live_messages live_metrics metrics model_file public_api
    report_figures report_page rooms short_columns short_excitation thresholds timing
    validate_before_record z_and_s
""".split()
SLOW = """
    test_memory_does_not_grow_with_the_bag test_only_the_asked_for_verb_is_loaded
    test_plug_in_of_the_documentation_as_a_third_party_installs_it test_walk_through_of_contributing
    test_the_package_can_be_imported_before_and_after test_random_damage_raises_bag_errors_only
""".split()
# Files of searches and Monte Carlos that take most of the time: `make test-all` runs them.
THOROUGH = """
    blind_scoring budget command_fleet diagnosis_beside_noise diagnosis_between_gaps
    diagnosis_companions diagnosis_courses diagnosis_high_pass diagnosis_in_bands
    diagnosis_late_steps diagnosis_laws diagnosis_like_axes diagnosis_noise_with_memory
    diagnosis_of_its_kind diagnosis_of_machines diagnosis_of_measured diagnosis_of_slow_bands
    diagnosis_of_structures diagnosis_off_clock diagnosis_on_the_road diagnosis_one_filter
    diagnosis_out_of_sight diagnosis_polled diagnosis_scattered_instants diagnosis_screening
    diagnosis_settled diagnosis_slow_motion diagnosis_soft_mount diagnosis_sprung diagnosis_steps
    diagnosis_sticking diagnosis_stretches diagnosis_strong_spring diagnosis_truthful
    diagnosis_turned diagnosis_unbounded diagnosis_under_gravity diagnosis_unequal_rates
    domains_agree empirical_link free_mass further_forces fuzz identify_general_equation keeper
    linear_causes long_records monitoring_watch outputs paper_command paper_study pooling
    published_shock real_records reference_faults reference_noise report_browser stepped_sine_points
    uncertain_motion write_errors
""".split()
# Files whose tests draw many records or sensors: the first draw of each test counts as the file
# does, and `make test-draws` runs the others.
MANY_DRAWS = """
    axis_monitors backlash budget changes_in_time core_response corrected_uncertainty
    corrector_uncertainty diagnosis_data_checks diagnosis_exchanged diagnosis_laws
    diagnosis_leftover diagnosis_noise_with_memory diagnosis_of_measured diagnosis_steps
    diagnosis_stretches diagnosis_truthful diagnosis_unequal_rates domains_agree
    effects_correction effects_simulation effects_streaming empirical_link further_forces
    gap_coverage identify_arx identify_auto identify_fractional identify_gain
    identify_general_equation identify_oscillator identify_records inverse_design linear_causes
    misalignment output_variance plausibility real_records record_orientation record_pairing
    reference_faults residual_causes rig_accuracy rig_road rig_second_set rig_uncatalogued
    simulation_accuracy spring_uncertainty streaming_identity
""".split()
# Files in which the first seed of each kind counts as the file does.
SEEDS = """
    diagnosis_across diagnosis_averaged_reference diagnosis_beside_noise diagnosis_between_gaps
    diagnosis_companions diagnosis_courses diagnosis_high_pass diagnosis_in_bands
    diagnosis_like_axes diagnosis_of_bent_gains diagnosis_of_instruments diagnosis_of_its_kind
    diagnosis_of_joints diagnosis_of_jumps diagnosis_of_machines diagnosis_of_slow_bands
    diagnosis_one_filter diagnosis_out_of_sight diagnosis_polled diagnosis_scattered_instants
    diagnosis_settled diagnosis_sprung diagnosis_sticking diagnosis_strong_spring diagnosis_turned
    diagnosis_under_gravity
""".split()


def is_colcon(config):
    """Whether `colcon test` has called: it names its results after the package."""
    return config.option.junitprefix == "frac_accel"


def pytest_configure(config):
    """Let `colcon test` run the fast part, unless it is told which."""
    if is_colcon(config):
        config.option.markexpr = config.option.markexpr or "fast"


def pytest_ignore_collect(collection_path, config):
    """Of the other files `colcon test` needs no libraries."""
    if is_colcon(config) and collection_path.suffix == ".py" \
            and collection_path.stem.removeprefix("test_") not in FAST:
        return True
    return None


def parameters_of(item):
    """Those that a test was given, by name."""
    return item.callspec.params if hasattr(item, "callspec") else {}


def pytest_collection_modifyitems(items):
    """Mark them; nothing is fast that is long or needs ROS or the real records."""
    seen = set()
    for item in items:
        file = item.path.stem.removeprefix("test_")
        if file in MANY_DRAWS or file in SEEDS:
            kind = [(name, str(value)) for name, value in parameters_of(item).items()
                    if name != "seed" and file in SEEDS]
            draw = item.path, item.originalname, *kind
            if draw in seen:
                item.add_marker(pytest.mark.long)
            seen.add(draw)
        if file in THOROUGH and not any(map(item.get_closest_marker, ("long", "ros"))):
            item.add_marker(pytest.mark.thorough)
        if file in FAST and item.originalname not in SLOW \
                and not any(map(item.get_closest_marker, ("long", "ros", "real_data"))):
            item.add_marker(pytest.mark.fast)
