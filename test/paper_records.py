"""Records of the seed paper's bench with other sensors, by the independent simulator."""

import sys
from pathlib import Path

import numpy as np
import rig

from frac_accel.io.bag import Samples
from frac_accel.record import Record

sys.path.append(str(Path(__file__).resolve().parents[1] / "bags"))

import make_paper_bench as bench


def pair_of(sensor, excitation, rng):
    """Pair as the bench's card has it, of a rig.Sensor."""
    record = rig.simulate_record(sensor, excitation, rng, snr_db=bench.SENSOR_NOISE_DB)
    topics = [Samples.of(record.stamps_ns, bench.STEP * np.round(values / bench.STEP))
              for values in (record.reference, record.sensor)]
    return Record.of(*topics)


def noise_and_sines(sensor, rng):
    """Pair to identify from and pair to judge on."""
    return (pair_of(sensor, bench.noise(rng), rng), pair_of(sensor, bench.sines(), rng))
