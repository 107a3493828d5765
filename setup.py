"""Build script of the ament_python package, for colcon and for pip."""

from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = "frac_accel"


def shared(folder):
    """Return the ``data_files`` entries that install `folder` below ``share/frac_accel``."""
    by_parent = {}
    for path in sorted(Path(folder).rglob("*")):
        if path.is_file() and path.parent.name != "__pycache__":
            by_parent.setdefault(f"share/{PACKAGE}/{path.parent}", []).append(str(path))
    return list(by_parent.items())


setup(
    name=PACKAGE,
    version="0.1.0",
    description="Identify, simulate, correct and diagnose accelerometers on ROS 2",
    license="Apache-2.0",
    maintainer="frac_accel developers",
    maintainer_email="maintainers@frac-accel.example",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["**/*.msg", "**/*.yaml", "**/*.html", "py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        ("bin", ["scripts/frac_accel"]),
        *shared("config"),
        *shared("launch"),
    ],
    zip_safe=False,
    python_requires=">=3.10",
    install_requires=[
        "setuptools",
        "numpy>=1.26.4",
        "scipy>=1.11.4",
        "PyYAML",
        "mcap>=1.6.0",  # Writer.flush
        "tqdm",
        "matplotlib",
        "plotly>=5.13",
        "numba>=0.57",  # simulation of nonlinear springs and friction
    ],
    extras_require={
        "bench": ["PyDynamic>=2.4"],  # what `frac_accel bench` compares with
        # `frac_accel fleet`: rows in Parquet, object stores, clusters (--scheduler)
        "fleet": ["pyarrow>=14", "fsspec>=2023.10", "distributed>=2023.10"],
    },
    entry_points={
        "console_scripts": [
            "frac_accel = frac_accel.cli:main",
            "corrector = frac_accel.nodes.corrector:main",
            "diagnoser = frac_accel.nodes.diagnoser:main",
            "player = frac_accel.nodes.player:main",
            "recorder = frac_accel.nodes.recorder:main",
            "virtual_sensor = frac_accel.nodes.virtual_sensor:main",
        ],
    },
)
