"""Write one case of the suite as a bag, with the truth beside it.

``python -m blind.tell GROUP SEED [CAUSE ...]``, with ``test`` and the repository's root on the
path. Without a cause the seed chooses one of the group's.
"""

import argparse
import json
import sys
from pathlib import Path

import yaml

from .plan import GROUPS, Trial, plan

ROOT = Path(__file__).resolve().parents[2]


def main(arguments=None):
    """Write ``GROUP_CAUSES_SEED.mcap``, ``….json`` (the truth) and ``….yaml`` (model in use)."""
    parser = argparse.ArgumentParser(prog="blind.tell", description=__doc__.splitlines()[0])
    parser.add_argument("group", choices=GROUPS)
    parser.add_argument("seed", type=int)
    parser.add_argument("causes", nargs="*", metavar="CAUSE",
                        help="what is hidden (default: as the seed has it)")
    parser.add_argument("--times-noise", type=float, help="effect's RMS over the noise's")
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "cases",
                        help="default: %(default)s")
    given = parser.parse_args(arguments)
    trial = of_seed(given.group, given.seed, given.causes)._replace(times_noise=given.times_noise)
    try:
        case = trial.case()
    except (KeyError, RuntimeError, ValueError) as error:
        print(f"blind.tell: no such case: {error}", file=sys.stderr)
        return 2
    given.folder.mkdir(parents=True, exist_ok=True)
    name = f"{trial.group}_{'+'.join(trial.causes) or 'none'}_{trial.seed}"
    bag, told, model = (given.folder / (name + end) for end in (".mcap", ".json", ".yaml"))
    case.write(bag)
    told.write_text(json.dumps(truth(case), indent=1) + "\n")
    model.write_text(yaml.safe_dump(case.baseline.to_model(), sort_keys=False))
    print(f"{bag}\n{told}\n{model}")
    return 0


def of_seed(group, seed, causes=()):
    """Trial of a group with any seed; without causes, with those of one of the group's trials."""
    causes = tuple(sorted(causes))
    if not causes:
        of_group = plan(0, [group])
        causes = of_group[seed % len(of_group)].causes
    return Trial(group, f"{group}/{'+'.join(causes) or 'none'}/{seed}", seed, causes)


def truth(case):
    """Everything that is hidden in a case, of plain values."""
    return {"hidden": case.truth, "besides": case.besides, "core": case.sensor.core,
            "noise_std": case.noise_std,
            "effect_over_noise": {cause: rms / case.noise_std
                                  for cause, rms in case.effect_rms.items()},
            "kind": case.kind, "excitation": case.excitation, "seed": case.seed,
            "sensor_model": case.sensor.to_model()}


if __name__ == "__main__":
    sys.exit(main())
