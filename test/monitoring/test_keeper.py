"""From a change to another model and back; killed in between, the old model stays."""

import json
import os
import signal
import time

import numpy as np
import pytest
from monitoring_rig import MODEL, ChangingDrive, chunks

from frac_accel.io.samples import Samples
from frac_accel.model import SensorModel
from frac_accel.monitoring.journal import Journal
from frac_accel.monitoring.keeper import Keeper
from frac_accel.monitoring.observations import LEARNING, Observer

EFFECT = {"sensitivity_error": {"gain": 1.1}}


@pytest.fixture(scope="module")
def drives():
    """A drive in which the sensor changes, and one after that."""
    return ChangingDrive(11, EFFECT, 250.0, duration_s=330.0), \
        ChangingDrive(12, EFFECT, duration_s=120.0)


def fed(keeper, drive, later_s=0):
    for parts in zip(*map(chunks, drive.samples())):
        keeper.add(*(part._replace(stamps_ns=part.stamps_ns + later_s * 10**9) for part in parts))
        keeper.turn()


def until(keeper, step, seconds=120):
    deadline = time.monotonic() + seconds
    while not any(line["step"] == step for line in keeper.journal.steps()):
        assert time.monotonic() < deadline, keeper.journal.steps()
        keeper.turn()
        time.sleep(0.05)


def made(folder, **wishes):
    (folder / "model.yaml").write_text(json.dumps(MODEL))
    given = []
    keeper = Keeper(folder / "model.yaml", folder / "results", "x", "confirmed", given.append,
                    false_alarm_h=1.0, budget=1.0, niceness=0, **wishes)
    return keeper, given


def test_a_change_is_diagnosed_confirmed_applied_and_taken_back(drives, tmp_path):
    keeper, given = made(tmp_path, time_limit_s=20.0)
    try:
        fed(keeper, drives[0])
        until(keeper, "diagnosed")
        assert [finding["cause"] for finding in keeper.latest["findings"]] == list(EFFECT)
        change = keeper.latest["onset"]
        assert abs(drives[0].since_start_s(change["ns"]) - 250.0) < 2.0
        assert given == []  # not before it has won on what came after
        fed(keeper, drives[1], 400)
        assert len(given) == 1
        model = SensorModel.load(given[0])
        [effect] = model.axis("x").effects
        assert effect.gain == pytest.approx(1.1, abs=0.01)
        keeper.given("")
        assert keeper.model_file == given[0] and keeper.watch.learning
        assert keeper.roll_back() == ""
        assert given[1] == str(tmp_path / "model.yaml")
        keeper.given("")
        assert keeper.roll_back() != ""
    finally:
        keeper.end()
    assert [line["step"] for line in keeper.journal.steps()] == [
        "started", "changed", "diagnosing", "diagnosed", "trial won", "applied", "rolled back"]
    names = {path.name for path in (tmp_path / "results").glob("2*/*")}
    assert {"result.json", "report.html", "model.yaml", "stretch.mcap"} <= names


def three(drive, rng, changed):
    """Sensor, reference and third of a drive, one of which shows 10 % more from 250 s on."""
    reference, sensor = drive.samples()
    after = drive.since_start_s(reference.stamps_ns) > 250
    def of(name):
        gain = np.where((name == changed) & after, 1.1, 1.0)[:, None]
        noise = drive.noise_std * rng.normal(size=reference.values.shape)
        return reference._replace(values=gain * reference.values + noise)
    gain = np.where((changed == "sensor") & after, 1.1, 1.0)[:, None]
    return (of("reference"), sensor._replace(values=gain * sensor.values), of("third"))


@pytest.mark.parametrize("changed", [pytest.param("sensor", marks=pytest.mark.long), "reference"])
def test_of_two_that_watch_each_other_a_third_tells_who_has_changed(tmp_path, changed):
    drive = ChangingDrive(13, {}, duration_s=300.0)
    keeper, _ = made(tmp_path, mutual=True)
    try:
        for parts in zip(*map(chunks, three(drive, np.random.default_rng(14), changed))):
            keeper.add(*parts)
            keeper.turn()
        assert keeper.blamed == changed
        assert keeper.state == ("diagnosing" if changed == "sensor" else "changed")
        assert (keeper.diagnose("a service") == "a diagnosis is under way") == (
            changed == "sensor")
    finally:
        keeper.end()


def test_without_a_third_nobody_is_blamed(tmp_path):
    drive = ChangingDrive(13, {}, duration_s=300.0)
    keeper, _ = made(tmp_path, mutual=True)
    for reference, sensor, _ in zip(*map(chunks, three(drive, np.random.default_rng(14),
                                                       "sensor"))):
        keeper.add(reference, sensor)
        keeper.turn()
    assert keeper.watch.changed is not None and keeper.blamed == "one of them"
    assert "may be as it was" in keeper.diagnose("a service") and keeper.state == "changed"


def test_killed_on_its_way_nothing_is_half_written_and_the_model_stays(drives, tmp_path):
    keeper, given = made(tmp_path, time_limit_s=20.0)
    fed(keeper, drives[0])
    assert keeper.state == "diagnosing"
    process = keeper._errand._process
    keeper._errand._budget, keeper._errand._begin_s = 0.0, time.monotonic()
    deadline = time.monotonic() + 60
    while not keeper._errand._is_stopped:  # its budget is used up
        assert time.monotonic() < deadline
        keeper.turn()
        time.sleep(0.02)
    state = (f"/proc/{process.pid}/stat")
    time.sleep(0.1)
    assert open(state).read().rsplit(")", 1)[1].split()[0] == "T"
    os.kill(process.pid, signal.SIGKILL)
    until(keeper, "diagnosed")
    assert keeper.latest["verdict"] == "failed" and given == []
    assert keeper.model_file == str(tmp_path / "model.yaml")
    # and the node itself, in the middle of a result
    (tmp_path / "results" / "2000-01-01T00-00-00.0.partial").mkdir()
    with open(tmp_path / "results" / "journal.jsonl", "a") as file:
        file.write('{"step": "appl')
    again = Journal(tmp_path / "results", 500.0)
    assert not list(again.folder.glob("*.partial"))
    assert again.models() == [] and again.steps()[-1]["step"] == "diagnosed"
    again.note("started")
    assert again.steps()[-1]["step"] == "started"


def test_the_folder_stays_small_and_keeps_models_in_use(tmp_path):
    journal = Journal(tmp_path, 0.01)
    places = []
    for i in range(5):
        folder = journal.begin()
        (folder / "model.yaml").write_bytes(bytes(4000))
        places.append(journal.complete(folder))
        if i == 0:
            journal.note("applied", model=str(places[0] / "model.yaml"), before="factory.yaml")
    left = [place for place in places if place.exists()]
    assert left == [places[0], places[4]]


def observed(observer, rng, gain=1.0, noise=0.05, low_hz=60.0, step=None, still=None):
    n, rate = 2000, 200.0
    time_s = np.arange(n) / rate
    values = rng.normal(size=(n, 3)) * noise
    from scipy.signal import lfilter
    pole = 0.96 * np.exp(2j * np.pi * low_hz / rate)
    ringing = lfilter([1.0], np.real(np.poly([pole, pole.conj()])), rng.normal(size=(n, 3)), axis=0)
    values += 0.1 * ringing + np.sin(2 * np.pi * 1.3 * time_s)[:, None]
    if still is not None:
        values = rng.normal(size=(n, 3)) * 1e-3 + still
    if step is not None:
        values = step * np.round(values / step)
    stamps = np.round(time_s * 1e9).astype(np.int64)
    return {entry.kind for entry in observer.add(Samples.of(stamps, values))}


@pytest.mark.parametrize("kind, usual, later", [
    ("noise", {}, {"noise": 2.0}), ("resonance", {}, {"low_hz": 45.0}),
    ("lost bits", {"step": 0.02}, {"step": 0.08}),
    ("offset at standstill", {}, {"still": (0.0, 0.0, 10.9)})])
def test_without_a_reference_it_says_what_it_sees(kind, usual, later):
    rng, observer = np.random.default_rng(3), Observer()
    for _ in range(LEARNING + 8):
        assert observed(observer, rng, **usual) == set()
    seen = [observed(observer, rng, **later) for _ in range(4)]
    assert seen[0] == seen[1] == set() and kind in seen[2] and kind in seen[3]
