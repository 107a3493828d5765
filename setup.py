"""Build script of the ament_python package, for colcon and for pip."""

import re
import sys
import xml.etree.ElementTree
from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = "frac_accel"
# colcon may run this through a link from elsewhere
ROOT = Path(__file__).resolve().parent
NODES = ("corrector", "diagnoser", "managed_corrector", "player", "recorder", "virtual_sensor")


def shared(folder, pattern="*"):
    """Return the ``data_files`` entries that install `folder` below ``share/frac_accel``."""
    by_parent = {}
    for path in sorted(Path(folder).rglob(pattern)):
        if path.is_file() and path.parent.name != "__pycache__":
            by_parent.setdefault(f"share/{PACKAGE}/{path.parent}", []).append(str(path))
    return list(by_parent.items())


def long_description(repository):
    """The README for an index of packages, from where links within the repository lead nowhere.

    They get the repository's address, or become words where it has none.
    """
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    if not repository:
        text = re.sub(r"!\[([^]]*)\]\((?!http)([^)]*)\)", r"\1: `\2` in the sources.", text)
        return re.sub(r"\[([^]]*)\]\((?!http)[^)]*\)", r"\1", text)
    for mark, way in (("!", "raw"), ("", "blob")):
        text = re.sub(rf"{mark}\[([^]]*)\]\((?!http)([^)]*)\)",
                      rf"{mark}[\1]({repository.rstrip('/')}/{way}/HEAD/\2)", text)
    return text


# A wheel's scripts all come on PATH, under names as common as `player`; and a file of ours in bin/
# would be the command's second one. What `ros2 run` and a workspace need is for colcon, which calls
# `install` or `develop`.
scripts, files = [f"{PACKAGE} = {PACKAGE}.cli:main"], []
if not {"bdist_wheel", "dist_info", "editable_wheel"} & set(sys.argv):
    scripts += [f"{node} = {PACKAGE}.nodes.{node}:main" for node in NODES]
    files += [("bin", [f"scripts/{PACKAGE}"])]

# What a ROS machine reads of the package, and an index of Python packages too.
about = xml.etree.ElementTree.parse(ROOT / "package.xml").getroot()
urls = {url.get("type"): url.text for url in about.findall("url")}

setup(
    name=PACKAGE,
    version=about.findtext("version"),
    description=" ".join(about.findtext("description").split()),
    long_description=long_description(urls.get("repository")),
    long_description_content_type="text/markdown",
    license=about.findtext("license"),
    maintainer=about.findtext("maintainer"),
    maintainer_email=about.find("maintainer").get("email"),
    project_urls=urls,
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["**/*.html", "py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        *shared("config"),
        *shared("launch"),
        # what `paper` and the demonstration read
        *shared("bags", "paper_bench*"),
        *shared("bags", "viscoelastic_bench*"),
        *files,
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
        "formats": ["rosbags>=0.10", "pyarrow", "asammdf>=8"],  # what `convert` reads and writes
        "ros": ["ros-jazzy-rclpy[fastrtps]", "ros-jazzy-common-interfaces"],  # ROS from wheels
        "test": ["pytest", "pytest-timeout", "rosbags"],  # the fast part of the suite
        "watch": ["rich"],  # the live table of `frac_accel watch`; rosdep key python3-rich
        "completion": ["shtab>=1.9.2"],  # makes completion scripts of argparse, also for fish
        # `frac_accel fleet`: rows in Parquet, object stores, clusters (--scheduler)
        "fleet": ["pyarrow>=14", "fsspec>=2023.10", "distributed>=2023.10"],
    },
    entry_points={"console_scripts": scripts},
)
