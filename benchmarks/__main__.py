"""Run all benchmarks, or those named: python benchmarks [NAME ...]."""

import importlib
import os
import pathlib
import sys

# BLAS threads would only measure how they get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

FOLDER = pathlib.Path(__file__).parent
NAMES = ("pydynamic_shock", "simulation_speed", "nonlinear_speed", "identify_peers",
         "mcap_writers", "identification_solvers")


def print_table(rows):
    """Columns as wide as their widest entry."""
    def text(value):
        return value if isinstance(value, str) else f"{value:.4g}"

    lines = [list(rows[0]), *([text(value) for value in row.values()] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines)]
    for line in lines:
        print("  ".join(entry.ljust(width) for entry, width in zip(line, widths)).rstrip())
    print()


def main(names):
    """Import, run and print each; an unknown name ends with status 2."""
    unknown = set(names) - set(NAMES)
    if unknown:
        print(f"no benchmark {', '.join(sorted(unknown))}; there are {', '.join(NAMES)}",
              file=sys.stderr)
        return 2
    sys.path[:0] = [str(FOLDER.parent), str(FOLDER)]
    for name in names or NAMES:
        module = importlib.import_module(name)
        print(f"{name}: {module.__doc__.splitlines()[0]}", flush=True)
        print_table(module.run())
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
