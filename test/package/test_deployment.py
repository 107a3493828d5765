"""What is handed out for vehicles is well formed, and the service does what it says."""

import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
UNIT = ROOT / "config" / "systemd" / "frac_accel@.service"
ENVIRONMENT = ROOT / "config" / "systemd" / "corrector.env"


@pytest.mark.parametrize("path", sorted((ROOT / "docker").glob("*.Dockerfile")),
                         ids=lambda path: path.stem)
def test_dockerfile_is_without_fault(path):
    hadolint = Path(sys.executable).with_name("hadolint")
    if not hadolint.exists():
        pytest.skip("hadolint is in .venv only")
    result = subprocess.run([hadolint, path], capture_output=True, text=True)
    assert result.returncode == 0 and not result.stdout, result.stdout + result.stderr


def test_dockerfiles_copy_what_there_is():
    for path in (ROOT / "docker").glob("*.Dockerfile"):
        copied = re.findall(r"^COPY (\S+)", path.read_text(), re.MULTILINE)
        assert copied and all((ROOT / source).exists() for source in copied)
    assert os.access(ROOT / "docker" / "entrypoint.sh", os.X_OK)
    subprocess.run(["bash", "-n", ROOT / "docker" / "entrypoint.sh"], check=True)


def test_extras_of_the_dockerfile_exist():
    text = (ROOT / "docker" / "python.Dockerfile").read_text()
    extras = re.search(r'"/source\[([\w,]+)\]"', text)[1].split(",")
    declared = (ROOT / "setup.py").read_text()
    assert all(f'"{extra}": [' in declared for extra in extras)


def test_unit_is_one_that_systemd_takes():
    if not shutil.which("systemd-analyze"):
        pytest.skip("systemd is not here")
    result = subprocess.run(["systemd-analyze", "verify", "--man=no", UNIT],
                            capture_output=True, text=True)
    assert result.returncode == 0 and not result.stderr, result.stderr


def test_systemd_finds_a_fault_in_a_unit(tmp_path):
    if not shutil.which("systemd-analyze"):
        pytest.skip("systemd is not here")
    wrong = tmp_path / UNIT.name
    wrong.write_text(UNIT.read_text().replace("WatchdogSec=", "WatchDog="))
    result = subprocess.run(["systemd-analyze", "verify", "--man=no", wrong],
                            capture_output=True, text=True)
    assert "WatchDog" in result.stderr


def settings():
    """The variables of the environment file, as systemd reads them."""
    lines = [line for line in ENVIRONMENT.read_text().splitlines() if line[:1] not in ("", "#")]
    return {name: "".join(shlex.split(value)) for name, _, value in
            (line.partition("=") for line in lines)}


def test_environment_names_files_that_an_installation_has():
    found = settings()
    assert found["NODE"].endswith("/lib/frac_accel/corrector")
    assert found["SETUP"].split()[-1].endswith("/install/setup.bash")
    assert (ROOT / "config" / Path(found["ROS_ARGS"].split()[-1]).name).is_file()
    # without a model it would run, and correct nothing
    assert "model_file:=/etc/frac_accel/sensor.yaml" in found["ROS_ARGS"].split()


@pytest.mark.ros
def test_service_says_that_it_is_ready_alive_and_ending(tmp_path):
    """The unit's own command, with a socket in the place of systemd's."""
    command = re.search(r"^ExecStart=(.*)$", UNIT.read_text(), re.MULTILINE)[1]
    limit_s = float(re.search(r"^WatchdogSec=(\d+)$", UNIT.read_text(), re.MULTILINE)[1])
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(30)
        environment = {
            **os.environ, **settings(), "SETUP": "", "ROS_DOMAIN_ID": "112",
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "PYTHONPATH": str(ROOT),
            "NODE": f"{sys.executable} -m frac_accel.nodes.corrector",
            "ROS_ARGS": f"-p model_file:={ROOT / 'config/models/classical.yaml'}",
            "NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "400000"}
        process = subprocess.Popen(shlex.split(command.replace("$$", "$")), env=environment,
                                   stderr=subprocess.PIPE, text=True)
        try:
            said, at = [], []
            while len(said) < 6:
                said.append(manager.recv(100).decode())
                at.append(time.monotonic())
            assert said == ["READY=1", *["WATCHDOG=1"] * 5]
            assert max(b - a for a, b in zip(at[1:], at[2:])) < limit_s
            process.send_signal(signal.SIGINT)
            while said[-1] == "WATCHDOG=1":
                said.append(manager.recv(100).decode())
            assert said[-1] == "STOPPING=1"
            assert process.wait(20) == 0
        finally:
            process.kill()
            process.wait()


@pytest.mark.ros
def test_nobody_is_told_where_no_service_manager_asks(tmp_path):
    from frac_accel.nodes._service import ServiceManager
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind("\0frac_accel-test-" + str(os.getpid()))
        manager.settimeout(0)
        name = "@frac_accel-test-" + str(os.getpid())
        other = {"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "1000", "WATCHDOG_PID": "1"}
        for environment in ({}, {"WATCHDOG_USEC": "1000"}, other,
                            {"NOTIFY_SOCKET": str(tmp_path / "gone"), "WATCHDOG_USEC": "1000"}):
            ServiceManager(environment).alive()
        with pytest.raises(BlockingIOError):
            manager.recv(100)
        ServiceManager(other | {"WATCHDOG_PID": str(os.getpid())}).alive()
        assert manager.recv(100) == b"WATCHDOG=1"
