"""The package builds, installs and starts as on a ROS machine, and imports only what it may."""

import ast
import configparser
import importlib.metadata
import json
import math
import os
import re
import runpy
import subprocess
import sys
import sysconfig
import xml.etree.ElementTree
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

from frac_accel.cli import main
from frac_accel.model import SensorModel
from frac_accel.report import layouts

ROOT = Path(__file__).parents[2]
NODES = ("corrector", "diagnoser", "managed_corrector", "player", "recorder", "virtual_sensor")


def run(command, **kwargs):
    """Run `command` from the repository and return what it did, its output as text."""
    kwargs = {"cwd": ROOT, "capture_output": True, "text": True, "timeout": 120} | kwargs
    return subprocess.run(command, **kwargs)


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Prefix of a fresh colcon build of the package."""
    pytest.importorskip("colcon_core")
    folder = tmp_path_factory.mktemp("colcon")
    result = run(
        [Path(sys.prefix, "bin", "colcon"), "--log-base", folder / "log", "build",
         "--build-base", folder / "build", "--install-base", folder / "install"],
        env=os.environ | {"AMENT_PREFIX_PATH": sys.prefix})
    assert result.returncode == 0, result.stdout + result.stderr
    return folder / "install" / "frac_accel"


def start(installed, command):
    """Run `command` in a shell that knows nothing but the built workspace's ``setup.bash``."""
    environment = {"HOME": os.environ["HOME"], "PATH": "/usr/bin:/bin",
                   "ROS_DOMAIN_ID": "111", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    return run(["bash", "-c", f"source '{installed.parent}/setup.bash' && exec {command}"],
               cwd="/", env=environment)


@pytest.mark.ros
def test_every_file_is_installed(installed):
    for folder in ("launch", "config"):
        for source in (ROOT / folder).rglob("*"):
            if source.is_file() and source.parent.name != "__pycache__":
                copy = installed / "share" / "frac_accel" / source.relative_to(ROOT)
                assert copy.read_bytes() == source.read_bytes()
    packages, = installed.glob("lib/python3*/site-packages")
    for source in (ROOT / "frac_accel").rglob("*"):
        if source.suffix in (".py", ".msg", ".yaml", ".html"):
            assert (packages / source.relative_to(ROOT)).is_file()
    share = installed / "share"
    assert (share / "frac_accel" / "package.xml").is_file()
    assert (share / "ament_index/resource_index/packages/frac_accel").is_file()


@pytest.mark.ros
def test_nodes_are_where_ros2_run_looks_and_only_the_command_is_on_path(installed):
    executables = {path.name for path in (installed / "lib" / "frac_accel").iterdir()}
    assert executables == {"frac_accel", *NODES}
    assert [path.name for path in (installed / "bin").iterdir()] == ["frac_accel"]


def collected(*options):
    """Identifiers of the tests that pytest would run."""
    shown = run([sys.executable, "-m", "pytest", "-q", "--collect-only", "-n", "0", *options])
    return [line for line in shown.stdout.splitlines() if "::" in line]


@pytest.mark.thorough
def test_colcon_test_is_given_the_fast_part_of_the_suite():
    fast = collected("-m", "fast")
    assert len(fast) > 500
    assert collected("--junit-prefix=frac_accel") == fast


@pytest.mark.ros
def test_colcon_test_runs_tests(installed):
    """A few of them, as `colcon test` finds them by `extras_require`; their number is told."""
    folder = installed.parents[1]
    result = run(
        [Path(sys.prefix, "bin", "colcon"), "--log-base", folder / "log", "test",
         "--build-base", folder / "build", "--install-base", folder / "install",
         "--pytest-args", "-k", "test_timing"],
        env=os.environ | {"AMENT_PREFIX_PATH": sys.prefix})
    assert result.returncode == 0, result.stdout + result.stderr
    suite = xml.etree.ElementTree.parse(
        folder / "build" / "frac_accel" / "pytest.xml").getroot().find("testsuite")
    expected = collected("-m", "fast", "-k", "test_timing")
    assert int(suite.get("tests")) == len(expected) > 0
    assert suite.get("failures") == suite.get("errors") == "0"


@pytest.mark.ros
def test_command_runs_from_the_workspace(installed):
    result = start(installed, "frac_accel --help")
    assert result.returncode == 0, result.stderr
    assert "identify" in result.stdout


@pytest.mark.ros
def test_corrector_refuses_a_missing_model_in_one_line(installed):
    result = start(
        installed,
        f"{installed}/lib/frac_accel/corrector --ros-args -p model_file:=/nowhere/model.yaml "
        f"--params-file {installed}/share/frac_accel/config/corrector.yaml")
    assert result.returncode == 2, result.stderr
    assert "/nowhere/model.yaml" in result.stderr
    assert "Traceback" not in result.stderr


def imported_by(modules):
    """Top-level packages of site-packages whose files a new interpreter loads for `modules`."""
    code = ("import json, sys; before = set(sys.modules); "
            f"import {', '.join(modules)}; "
            "loaded = [sys.modules[name] for name in set(sys.modules) - before]; "
            "print(json.dumps([getattr(module, '__file__', None) for module in loaded]))")
    result = run([sys.executable, "-c", code])
    assert result.returncode == 0, result.stderr
    files = [Path(file) for file in json.loads(result.stdout) if file]
    site = Path(sysconfig.get_path("purelib"))
    return {file.relative_to(site).parts[0] for file in files if site in file.parents}


def ros_packages():
    """Top-level packages of the ROS wheels."""
    return {package for package, names in importlib.metadata.packages_distributions().items()
            if any(re.match("ros-(?!parser)", name) for name in names)}


@pytest.mark.ros
@pytest.mark.parametrize("node", ["corrector", "virtual_sensor"])
def test_live_nodes_import_only_what_a_stock_jazzy_has(node):
    allowed = {"numpy", "scipy", "yaml", "_yaml"}
    assert not imported_by([f"frac_accel.nodes.{node}"]) - allowed - ros_packages()


def test_numerical_code_imports_no_ros():
    code = ROOT / "frac_accel"
    modules = [
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        for path in sorted(code.rglob("*.py"))
        if code / "nodes" not in path.parents and path.name != "__main__.py"
    ]
    packages = imported_by(modules)
    assert "numpy" in packages
    assert not packages & ({"rclpy", "sensor_msgs", "std_msgs"} | ros_packages())


def needed():
    """Keys that package.xml asks `rosdep` for."""
    root = xml.etree.ElementTree.parse(ROOT / "package.xml").getroot()
    return {element.text for element in root if element.tag.endswith("depend")}


def test_rosdep_knows_every_key():
    known = yaml.safe_load((ROOT / "test" / "package" / "rosdep_keys.yaml").read_text())
    assert needed() <= {*known["keys"], *known["jazzy"]}


def test_every_library_has_its_key_or_is_asked_for_in_one_line(capsys, monkeypatch):
    about = importlib.metadata.requires("frac_accel")
    libraries = {re.match(r"[\w.-]+", line)[0] for line in about if "extra ==" not in line}
    keys = yaml.safe_load(
        (ROOT / "test" / "package" / "rosdep_keys.yaml").read_text())["libraries"]
    assert libraries == set(keys)
    assert {key for key in keys.values() if key} | {"python3-rich"} <= needed()  # rich: watch
    for library in (name for name, key in keys.items() if not key):
        monkeypatch.setitem(sys.modules, library, None)
        assert main(["diagnose", "none.mcap", "--report", "report.html"]) == 2
        line, = capsys.readouterr().err.splitlines()
        assert f"pip install {library}" in line


@pytest.mark.parametrize("library, name",
                         [("mcap", "mcap"), ("scipy", "scipy"), ("yaml", "PyYAML")])
def test_a_library_that_is_missing_is_one_line_and_status_2(library, name, tmp_path):
    bag = ROOT / "bags" / "fractional_bench.mcap"
    code = (f"import sys; sys.modules[{library!r}] = None; from frac_accel.cli import main; "
            f"sys.exit(main(['correct', {str(bag)!r}, '--model', "
            f"{str(bag.with_suffix('.yaml'))!r}, '-o', {str(tmp_path / 'out.mcap')!r}]))")
    result = run([sys.executable, "-c", code])
    assert result.returncode == 2, result.stderr
    line, = result.stderr.splitlines()
    assert f"the Python library {library} is missing; install it with pip install {name}" in line


def declared_arguments(tree, function):
    """First arguments of the calls to `function` in a syntax tree."""
    return {node.args[0].value for node in ast.walk(tree)
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == function}


LAUNCHED = ["bench.launch.py", "diagnoser.launch.py", "managed.launch.py", "vehicle.launch.py"]


def node_calls(tree):
    """Executable and names of the own parameters of every ``Node(...)`` in a syntax tree."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("Node", "LifecycleNode"):
            keywords = {keyword.arg: keyword.value for keyword in node.keywords}
            names = [key.value for element in keywords["parameters"].elts
                     if isinstance(element, ast.Dict) for key in element.keys]
            yield keywords["executable"].value, names


@pytest.mark.parametrize("name", LAUNCHED)
def test_launch_file_uses_each_argument_that_it_declares(name):
    tree = ast.parse((ROOT / "launch" / name).read_text())
    declared = declared_arguments(tree, "DeclareLaunchArgument")
    assert declared == declared_arguments(tree, "LaunchConfiguration")
    executables = {executable for executable, _ in node_calls(tree)}
    assert executables and executables <= set(NODES)


def test_on_a_vehicle_a_corrector_that_has_died_is_started_again():
    tree = ast.parse((ROOT / "launch" / "vehicle.launch.py").read_text())
    given, = ({keyword.arg: keyword.value for keyword in call.keywords} for call in ast.walk(tree)
              if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "Node")
    assert {"name", "use_sim_time", "temperature_topic"} <= declared_arguments(
        tree, "DeclareLaunchArgument")
    assert ast.literal_eval(given["executable"]) == "corrector"
    assert ast.literal_eval(given["respawn"]) is True
    assert ast.literal_eval(given["respawn_delay"]) <= 2.0


@pytest.mark.parametrize("name", LAUNCHED)
def test_launch_file_is_a_description(name):
    pytest.importorskip("launch_ros", reason="launch comes with an installed ROS only")
    namespace = runpy.run_path(ROOT / "launch" / name)
    assert len(namespace["generate_launch_description"]().entities) > 1


# the managed corrector has the name and the parameters of the other
@pytest.mark.parametrize("node", sorted({*NODES} - {"managed_corrector"}))
def test_launch_and_config_set_only_parameters_of_the_node(node):
    given = set()
    for path in (ROOT / "launch").glob("*.launch.py"):
        for executable, names in node_calls(ast.parse(path.read_text())):
            given |= set(names) if executable == node else set()
    for path in (ROOT / "config").glob("*.yaml"):
        document = yaml.safe_load(path.read_text())
        for section in (f"/**/{node}", *(["/**"] if node == "corrector" else [])):
            own = document.get(section, {}).get("ros__parameters", {})
            given |= set(own).difference(own.get("sensors", ()))
    folder = ROOT / "frac_accel" / "nodes"
    sources = [folder / f"{node}.py", folder / "_filtered_topic.py",
               folder / "_sensor_parameters.py"]
    literals = {part.value for path in sources for part in ast.walk(ast.parse(path.read_text()))
                if isinstance(part, ast.Constant)}
    # what every node of rclpy has
    assert given and given <= literals | {"use_sim_time", "qos_overrides"}


def test_example_models_load():
    examples = sorted((ROOT / "config" / "models").glob("*.yaml"))
    assert len(examples) >= 2
    for path in examples:
        assert len(SensorModel.load(path).axes) == 3


def test_layouts_plot_raw_reference_and_corrected():
    text = (ROOT / "config" / "foxglove_layout.json").read_text(encoding="utf-8")
    assert text == layouts.foxglove(layouts.Topics())
    panels = json.loads(text)["configById"].values()
    assert all(panel["foxglovePanelTitle"] for panel in panels)
    paths = {path["value"] for panel in panels for path in panel.get("paths", [])}
    file = ROOT / "config" / "plotjuggler_layout.xml"
    assert file.read_text(encoding="utf-8") == layouts.plotjuggler(layouts.Topics())
    tree = xml.etree.ElementTree.parse(file)
    curves = {curve.get("name") for curve in tree.iter("curve")}
    bands = {snippet.get("name") for snippet in tree.iter("snippet")}
    assert len(bands) == 6 and bands < curves
    assert {path.replace(".", "/") for path in paths if "2u" not in path} == curves - bands
    for topic in ("/imu/data_raw", "/imu/reference", "/imu/data"):
        assert f"{topic}/linear_acceleration/x" in curves
    assert all(area.get("name") not in ("", "...") for area in tree.iter("DockArea"))


def test_layouts_of_a_namespace(tmp_path):
    for program in ("foxglove", "plotjuggler"):
        file = tmp_path / program
        assert main(["layout", program, "--namespace", "/axle/front/", "-o", str(file)]) == 0
        text = file.read_text(encoding="utf-8")
        names = re.findall(r'(?<!/studio_script)(/[\w/]*(?:/imu/|metrics)[\w/]*)', text)
        assert names and all(name.startswith(("/axle/front/imu/", "/axle/front/corrector/metrics"))
                             for name in names)
        assert main(["layout", program, "--namespace", "axle front", "-o", str(file)]) == 2
        assert main(["layout", program, "--node", "/corrector", "--sensor", "front",
                     "-o", str(file)]) == 0
        assert "/corrector/metrics/front/x/raw/nrmse" in file.read_text(encoding="utf-8")


def test_the_band_of_a_layout_is_two_uncertainties_about_the_sample():
    """Each program's expression, run as Python."""
    source = json.loads(layouts.foxglove(layouts.Topics()))["userNodes"]["band"]["sourceCode"]
    acceleration = SimpleNamespace(x=1.0, y=2.0, z=3.0)
    covariance = [0.01, 0, 0, 0, 0.04, 0, 0, 0, 0.09]
    for end, sign in (("lower", -1), ("upper", 1)):
        inner = re.search(rf"{end}: {{ (.*) }},", source)[1]
        found = {name: eval(expression.replace("Math", "math"),
                            {"a": acceleration, "c": covariance, "math": math})
                 for name, expression in (part.split(": ") for part in inner.split(", "))}
        assert found == pytest.approx({"x": 1 + sign * 0.2, "y": 2 + sign * 0.4,
                                       "z": 3 + sign * 0.6})
    tree = xml.etree.ElementTree.fromstring(layouts.plotjuggler(layouts.Topics()))
    for snippet in tree.iter("snippet"):
        axis, sign = snippet.get("name").split()[1:3]
        found = eval(snippet.findtext("function").removeprefix("return "),
                     {"value": 5.0, "v1": 0.25, "math": math})
        assert found == 5.0 + (1.0 if sign == "+" else -1.0)
        place = "xyz".index(axis)
        assert snippet.findtext("additional_sources/v1").endswith(f"covariance[{place};{place}]")
        assert snippet.findtext("linked_source").endswith(f"/{axis}")


def test_version_is_the_same_everywhere():
    version = xml.etree.ElementTree.parse(ROOT / "package.xml").findtext("version")
    assert f"\n{version} (" in (ROOT / "CHANGELOG.rst").read_text()


def test_scripts_go_where_ros2_run_looks():
    config = configparser.ConfigParser()
    config.read(ROOT / "setup.cfg")
    assert config["install"]["install_scripts"] == "$base/lib/frac_accel"
    assert config["develop"]["script_dir"] == "$base/lib/frac_accel"
