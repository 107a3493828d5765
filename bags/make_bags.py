"""Make the bags of this folder: ``python bags/make_bags.py``, from a checkout with `make setup`.

The data come from the independent simulator in test/rig, never from the package's own simulation.
The model file beside a bag holds the sensor's true parameters; that of soft_mount leaves out two
effects, for `diagnose` to find.
"""

import sys
from pathlib import Path

import numpy as np
import yaml

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "test")]

import rig  # noqa: E402  (lives beside the tests)

from frac_accel import write_bag  # noqa: E402
from frac_accel.io.bag import RAW_TOPIC, REFERENCE_TOPIC, Samples  # noqa: E402

RATE_HZ = 1000.0

# A soft-mounted vehicle sensor whose damping is viscoelastic, with a slow interface.
FRACTIONAL = rig.Sensor(
    core={"type": "oscillator", "natural_frequency_hz": 110.0, "damping_ratio": 0.22,
          "damping_order": 0.6, "sensitivity": 0.96},
    effects={"low_pass_lag": {"corner_hz": 160.0}, "time_delay": {"delay_s": 0.0023},
             "cross_axis_sensitivity": {"x": 0.015, "y": -0.02, "z": 0.01},
             "offset": {"offset": 0.12}})

# One whose damping is all that is unusual about it: what `identify` can tell from one axis.
VISCOELASTIC = rig.Sensor(
    core={"type": "oscillator", "natural_frequency_hz": 110.0, "damping_ratio": 0.22,
          "damping_order": 0.6, "sensitivity": 0.96},
    effects={"time_delay": {"delay_s": 0.0023}, "offset": {"offset": 0.12}})

# A laboratory sensor on a shaker, one axis.
CLASSICAL = rig.Sensor(
    core={"type": "oscillator", "natural_frequency_hz": 180.0, "damping_ratio": 0.15,
          "damping_order": 1.0, "sensitivity": 1.02},
    effects={"time_delay": {"delay_s": 0.0006}})

# One on a soft mount that is driven hard: its spring hardens, and its interface is late.
SOFT_MOUNT = rig.Sensor(
    core={"type": "oscillator", "natural_frequency_hz": 85.0, "damping_ratio": 0.12,
          "damping_order": 1.0, "sensitivity": 0.98},
    effects={"cubic_stiffness": {"alpha3": 2.5e-4}, "time_delay": {"delay_s": 0.0013}})


def main():
    """Write all bags."""
    rng = np.random.default_rng(20261121)
    excitation = rig.band_noise(rng, RATE_HZ, 4.0, (1.0, 150.0), (2.0, 1.5, 3.0), lead_s=2.0)
    write("fractional_bench", FRACTIONAL, excitation, rng, snr_db=60)
    excitation = rig.band_noise(rng, RATE_HZ, 4.0, (2.0, 300.0), (3.0, 0.0, 0.0), lead_s=2.0)
    write("classical_bench", CLASSICAL, excitation, rng, snr_db=40)
    excitation = rig.sines(RATE_HZ, 1.0, [300.0], [0.0], (3.0, 0.0, 0.0), lead_s=1.0)
    write("one_sine", CLASSICAL, excitation, rng, snr_db=40)
    excitation = rig.band_noise(rng, RATE_HZ, 4.0, (1.0, 250.0), (2.0, 1.5, 3.0), lead_s=2.0)
    write("viscoelastic_bench", VISCOELASTIC, excitation, rng, snr_db=60)
    excitation = rig.band_noise(rng, RATE_HZ, 5.5, (2.0, 250.0), (8.0, 0.0, 0.0), lead_s=1.0)
    write("soft_mount", SOFT_MOUNT, excitation, rng, snr_db=50,
          in_use=rig.Sensor(SOFT_MOUNT.core))


def write(name, sensor, excitation, rng, snr_db, in_use=None):
    """One bag and the model file of its sensor, or of what is taken for it (`in_use`)."""
    record = rig.simulate_record(sensor, excitation, rng, snr_db=snr_db)
    variance = np.broadcast_to(np.square(record.noise_std), record.sensor.shape)
    write_bag(HERE / f"{name}.mcap", {
        REFERENCE_TOPIC: Samples.of(record.stamps_ns, record.reference,
                                    frame_id="reference_link"),
        RAW_TOPIC: Samples.of(record.sensor_stamps_ns, record.sensor, variance)})
    (HERE / f"{name}.yaml").write_text(
        yaml.safe_dump((in_use or sensor).to_model(), sort_keys=False))


if __name__ == "__main__":
    main()
