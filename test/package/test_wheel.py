"""The built wheel installs with pip, uv and PyPA's installer, and works from what was installed."""

import re
import shutil
import site
import subprocess
import sys
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
URL = "https://example.org/frac_accel"
pytest.importorskip("build", reason="what builds and installs is in .venv only")


def run(*command, **kwargs):
    """Run a command, without this tree on its path, and return what it did."""
    kwargs = {"capture_output": True, "text": True, "timeout": 120, "cwd": "/",
              "env": {"PATH": "/usr/bin:/bin", "HOME": "/nonexistent"}} | kwargs
    return subprocess.run(command, **kwargs)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built from a source distribution; an address in package.xml is to come through."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    shutil.copytree(ROOT, source, ignore=shutil.ignore_patterns(
        ".*", "build", "install", "*.egg-info", "__pycache__", "test", "benchmarks"))
    about = source / "package.xml"
    about.write_text(about.read_text().replace(
        "  <depend>", f'  <url type="repository">{URL}</url>\n  <depend>', 1))
    built = run(sys.executable, "-m", "build", "--no-isolation", "--outdir", folder, source)
    assert built.returncode == 0, built.stdout + built.stderr
    found, = folder.glob("*.whl")
    return found


def with_pip(python, wheel):
    return run(sys.executable, "-m", "pip", "--python", python, "install", "--no-deps",
               "--no-index", wheel)


def with_uv(python, wheel):
    return run(sys.executable, "-m", "uv", "--no-cache", "pip", "install", "--offline", "--no-deps",
               "--python", python, wheel)


def with_installer(python, wheel):
    return run(python, "-m", "installer", wheel,
               env={"PYTHONPATH": site.getsitepackages()[0], "PATH": "/usr/bin:/bin"})


@pytest.fixture(scope="module", params=[with_pip, with_uv, with_installer])
def installed(request, wheel, tmp_path_factory):
    """A venv with the package and none of its dependencies."""
    folder = tmp_path_factory.mktemp("venv")
    assert run(sys.executable, "-m", "venv", "--without-pip", folder).returncode == 0
    before = {path.name for path in (folder / "bin").iterdir()}
    done = request.param(folder / "bin" / "python", wheel)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder, {path.name for path in (folder / "bin").iterdir()} - before


def test_only_the_command_comes_on_path(installed):
    folder, scripts = installed
    assert scripts == {"frac_accel"}
    shown = run(folder / "bin" / "frac_accel", "--help")
    assert shown.returncode == 0 and "identify" in shown.stdout, shown.stderr


def test_nodes_without_ros_say_so_in_one_line(installed):
    result = run(installed[0] / "bin" / "python", "-m", "frac_accel.nodes.corrector")
    line, = result.stderr.splitlines()
    assert result.returncode == 2
    assert "need ROS 2" in line and "setup.bash" in line and "frac_accel[ros]" in line


@pytest.mark.parametrize("installed", [with_uv], indirect=True)
def test_bags_of_the_demonstration_are_installed_and_found(installed, tmp_path):
    folder, _ = installed
    packages, = folder.glob("lib/python3*/site-packages")
    # dependencies, but nothing of this checkout: a path in a .pth runs no other .pth
    (packages / "dependencies.pth").write_text(site.getsitepackages()[0] + "\n")
    found = run(folder / "bin" / "python", "-c", "import frac_accel.demo, frac_accel.paper as p; "
                "print(frac_accel.__file__, frac_accel.demo.BAGS, p.BAGS, sep='\\n')")
    module, *bags = map(Path, found.stdout.splitlines())
    assert packages in module.parents, found.stderr
    assert bags == 2 * [folder / "share" / "frac_accel" / "bags"]
    bag = bags[0] / "viscoelastic_bench.mcap"
    done = run(folder / "bin" / "frac_accel", "correct", bag, "--model", bag.with_suffix(".yaml"),
               "-o", tmp_path / "corrected.mcap")
    assert done.returncode == 0 and "samples corrected" in done.stdout, done.stderr


def test_metadata(wheel):
    with zipfile.ZipFile(wheel) as archive:
        name, = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        text = archive.read(name).decode()
        entries = archive.read(name.replace("METADATA", "entry_points.txt")).decode()
    about = Parser().parsestr(text)
    assert about["Project-URL"] == f"repository, {URL}"
    assert about["Maintainer-email"] and about["Description-Content-Type"] == "text/markdown"
    text, readme = about.get_payload(), (ROOT / "README.md").read_text()
    assert f"]({URL}/raw/HEAD/docs/demo.png)" in text
    assert f"[`docs/nodes.md`]({URL}/blob/HEAD/docs/nodes.md)" in text
    assert text.replace(f"{URL}/raw/HEAD/", "").replace(
        f"{URL}/blob/HEAD/", "").strip() == readme.strip()
    assert entries.split() == "[console_scripts] frac_accel = frac_accel.cli:main".split()


def test_without_an_address_the_description_has_no_link_that_leads_nowhere():
    shown = run(sys.executable, "setup.py", "-q", "--long-description", cwd=ROOT)
    assert shown.returncode == 0, shown.stderr
    assert not re.findall(r"\]\((?!http)", shown.stdout)
    assert "`docs/nodes.md` lists topics" in shown.stdout and "frac_accel identify" in shown.stdout
