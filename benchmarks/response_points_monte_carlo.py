"""Coverage and errors of measured response points, by excitation, noise level and colour.

Run by hand: PYTHONPATH=.:test python benchmarks/response_points_monte_carlo.py [--sensors N]
"""

import argparse

import numpy as np
import rig
from lab_records import EXCITATIONS, draw_sensor, noisy, pair_of, relative_error

from frac_accel.identification import response_points

_NOISES = 8


def scores(kind, sensors, snr_db, pole):
    """Errors in standard uncertainties, largest relative error, and number of points."""
    rng = np.random.default_rng(1)
    found, worst = [], 0.0
    for _ in range(sensors):
        sensor = draw_sensor(rng)
        record = rig.simulate_record(sensor, EXCITATIONS[kind](rng))
        for _ in range(_NOISES):
            points = response_points(pair_of(record, noisy(record, rng, snr_db, pole)))
            error = relative_error(points, sensor)
            worst = max(worst, float(np.max(np.abs(error))))
            found += [error.real / points.std_amplitude, error.imag / points.std_phase_rad]
    return np.concatenate(found), worst


def main():
    """Print one line for each condition."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sensors", type=int, default=4)
    sensors = parser.parse_args().sensors
    print(f"{'excitation':13} {'SNR [dB]':>8} {'AR pole':>7} {'trials':>7} {'within 1.96':>11} "
          f"{'RMS score':>9} {'worst error':>11}")
    for kind in EXCITATIONS:
        for snr_db in (60, 20):
            for pole in (0.0, 0.9):
                found, worst = scores(kind, sensors, snr_db, pole)
                print(f"{kind:13} {snr_db:8} {pole:7} {len(found):7} "
                      f"{np.mean(np.abs(found) < 1.96):11.4f} {np.sqrt(np.mean(found**2)):9.3f} "
                      f"{worst:11.2g}", flush=True)


if __name__ == "__main__":
    main()
