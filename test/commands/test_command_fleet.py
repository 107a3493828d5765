"""`frac_accel fleet`: every bag once, whatever dies; the rows are what the single commands say."""

import importlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import fleet_rig
import numpy as np
import pytest

import frac_accel
from frac_accel.cli import main
from frac_accel.diagnosis import Diagnosis

pytest.importorskip("pyarrow")
fsspec = pytest.importorskip("fsspec")

from frac_accel.commands.fleet import row  # noqa: E402
from frac_accel.fleet.store import Store  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
BAGS = 50
# One vehicle is made by the rig; the bags differ by noise and by the time of their beginning.
SECONDS = 2.0


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """Folder of bags over three days, and the model in use."""
    folder = tmp_path_factory.mktemp("drives")
    rng = np.random.default_rng(2)
    own = fleet_rig.vehicle(rng, duration_s=SECONDS)
    (folder / "bags").mkdir()
    for i in range(BAGS):
        fleet_rig.write_bag(folder / "bags" / f"drive_{i:03}.mcap", own, rng, 4000.0 * i)
    (folder / "model.yaml").write_text(json.dumps(fleet_rig.model()))
    return folder


def started(*arguments):
    """The command as a process of its own."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "test")])}
    return subprocess.Popen([sys.executable, "-m", "frac_accel.cli", "fleet", *map(str, arguments)],
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            env=environment)


def children(pid):
    """Processes that a process has started and that do a fleet's work."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            if int(status.read_text().rsplit(")", 1)[1].split()[1]) == pid \
                    and "spawn_main" in (status.parent / "cmdline").read_text():
                found.append(int(status.parent.name))
        except (OSError, ValueError):
            pass
    return found


def rows(folder, verb):
    return Store(str(folder), verb).read().to_pylist()


def test_workers_and_client_are_killed_and_every_bag_is_corrected_once(drives, tmp_path):
    command = ("correct", drives / "bags", "-o", tmp_path, "--model", drives / "model.yaml",
               "--workers", 2)
    process, rng, kills = started(*command), np.random.default_rng(1), 0
    # the first run loses workers, and then its client
    files = tmp_path / "correct-files"
    while process.poll() is None and kills < 3:
        time.sleep(0.2)
        workers = children(process.pid)
        if files.exists() and len(list(files.glob("*.mcap"))) > 3 * kills and workers:
            os.kill(int(rng.choice(workers)), signal.SIGKILL)
            kills += 1
            time.sleep(0.5)
    assert kills == 3
    time.sleep(0.5)
    orphans = children(process.pid)
    process.kill()
    process.communicate()
    deadline = time.monotonic() + 20
    while any(Path(f"/proc/{pid}").exists() and "spawn_main" in
              Path(f"/proc/{pid}/cmdline").read_text() for pid in orphans):
        assert time.monotonic() < deadline, "workers outlive their client"
        time.sleep(0.1)
    process = started(*command)
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    seen = rows(tmp_path, "correct")
    assert len(seen) == len({entry["sha256"] for entry in seen}) == BAGS
    assert not any(entry["error"] for entry in seen)
    assert not list(tmp_path.rglob("*.partial"))
    # again: nothing is left to do
    assert main(["fleet", *map(str, command)]) == 0
    assert len(rows(tmp_path, "correct")) == BAGS
    # what one bag gives alone, to the last bit (a bag holds its own name)
    (tmp_path / "alone").mkdir()
    for entry in seen[::17]:
        alone = tmp_path / "alone" / Path(entry["output"]).name
        assert main(["correct", entry["bag"], "--model", str(drives / "model.yaml"),
                     "-o", str(alone)]) == 0
        assert alone.read_bytes() == (tmp_path / entry["output"]).read_bytes()
    assert max(entry["memory_mb"] for entry in seen) < 300


def test_rows_of_diagnoses_are_what_the_command_says(drives, tmp_path, capsys):
    bags = sorted((drives / "bags").iterdir())[:3]
    folder = tmp_path / "some"
    folder.mkdir()
    for bag in bags:
        shutil.copy(bag, folder)
    shutil.copy(ROOT / "bags" / "soft_mount.mcap", folder)
    shutil.copy(bags[0], folder / "twin.mcap")
    (folder / "damaged.mcap").write_bytes(b"no bag at all")
    (tmp_path / "table.csv").write_text("bag,vehicle,lot,model\n" + "".join(
        f"{name},car {i},A,{drives / 'model.yaml'}\n" for i, name in
        enumerate([*(bag.name for bag in bags), "twin.mcap"]))
        + f"soft_mount.mcap,car 9,B,{ROOT / 'bags' / 'soft_mount.yaml'}\n")
    status = main(["fleet", "diagnose", str(folder), "-o", str(tmp_path / "out"), "--columns",
                   str(tmp_path / "table.csv"), "--workers", "1"])
    assert status == 4
    seen = {Path(entry["bag"]).name: entry for entry in rows_of(tmp_path / "out", "diagnose")}
    # the same content under two names is one bag
    assert len(seen) == 5 and len({"twin.mcap", bags[0].name} & seen.keys()) == 1
    assert "wrong magic" in seen["damaged.mcap"]["error"]
    mount = seen["soft_mount.mcap"]
    assert mount["causes"] == ["time_delay", "cubic_stiffness"] and mount["lot"] == "B"
    main(["diagnose", str(ROOT / "bags" / "soft_mount.mcap"), "--model",
          str(ROOT / "bags" / "soft_mount.yaml"), "--json", str(tmp_path / "one.json")])
    one = json.loads((tmp_path / "one.json").read_text())
    assert {(e["cause"], e["parameter"]): (e["value"], e["std"]) for e in mount["parameters"]} == {
        (f["cause"], name): (p["value"], p["std"]) for f in one["findings"]
        for name, p in f["parameters"].items()}
    kept = json.loads((tmp_path / "out" / mount["result"]).read_text())
    assert kept["findings"] == one["findings"]
    screened = Diagnosis.from_dict(kept).screened
    count = len(screened["estimates"])
    assert count > 15 and len(screened["correlations"]) == count * (count - 1) // 2
    page = (tmp_path / "out" / "diagnose.html").read_text()
    assert f'href="{mount["page"]}"' in page and (tmp_path / "out" / mount["page"]).exists()
    assert "1 failed" in capsys.readouterr().out


def rows_of(folder, verb):
    """As others read them."""
    duckdb, pandas = pytest.importorskip("duckdb"), pytest.importorskip("pandas")
    pattern = f"{folder}/{verb}/**/*.parquet"
    count = duckdb.sql(f"SELECT count(*) FROM read_parquet('{pattern}', hive_partitioning=true) "
                       "WHERE date IS NOT NULL").fetchall()[0][0]
    frame = pandas.read_parquet(folder / verb)
    assert len(frame) == count
    frame["causes"] = [None if causes is None else list(causes) for causes in frame["causes"]]
    return frame.to_dict("records")


def test_identify_and_validate_have_rows_as_well(drives, tmp_path):
    bag = str(sorted((drives / "bags").iterdir())[0])
    assert main(["fleet", "identify", bag, "-o", str(tmp_path), "--structure", "oscillator",
                 "--workers", "1"]) == 0
    [identified] = rows(tmp_path, "identify")
    frequency = next(e for e in identified["parameters"]
                     if e["parameter"] == "natural_frequency_hz")
    assert abs(frequency["value"] - 80) < 5 * frequency["std"] + 1e-3
    assert main(["fleet", "validate", bag, "-o", str(tmp_path), "--workers", "1", "--model",
                 str(tmp_path / identified["output"])]) == 0
    [judged] = rows(tmp_path, "validate")
    assert judged["nrmse"] < 0.01 and judged["corrected_nrmse"] < judged["scaled_nrmse"]


def here(function, tasks):
    """A map such as Ray or Spark have one."""
    return [function(task) for task in reversed(tasks)]


def test_bags_and_results_in_an_object_store(drives, monkeypatch):
    fs = fsspec.filesystem("memory")
    for bag in sorted((drives / "bags").iterdir())[:2]:
        fs.pipe(f"/store/{bag.name}", bag.read_bytes())
    name = f"{Path(__file__).stem}:here"
    monkeypatch.syspath_prepend(Path(__file__).parent)
    importlib.import_module(Path(__file__).stem)
    assert main(["fleet", "correct", "memory://store/*.mcap", "-o", "memory://results",
                 "--model", str(drives / "model.yaml"), "--map", name]) == 0
    seen = rows("memory://results", "correct")
    assert sorted(entry["bag"] for entry in seen) == [
        f"memory:///store/drive_00{i}.mcap" for i in range(2)]
    for entry in seen:
        assert fs.size(f"/results/{entry['output']}") > 10_000
    assert fs.exists("/results/correct.html")


def test_a_row_never_raises():
    told = row({"verb": "correct", "bag": "nowhere.mcap", "arguments": ["--nothing"]})
    assert "the options are not those of correct" in told["error"]
    told = row({"verb": "diagnose", "bag": "nowhere.mcap", "arguments": []})
    assert "no such bag" in told["error"]


def test_a_bag_that_ends_its_worker_is_a_row(drives, tmp_path):
    # less memory than the libraries take: every worker dies or says so
    status = main(["fleet", "diagnose", str(sorted((drives / "bags").iterdir())[0]), "-o",
                   str(tmp_path), "--workers", "1", "--memory", "60"])
    assert status == 4
    [told] = rows(tmp_path, "diagnose")
    assert re.search("memory|workers died|unforeseen|nobody", told["error"])


def refusal(capsys, *arguments):
    assert main(["fleet", *map(str, arguments)]) == 2
    [line] = capsys.readouterr().err.splitlines()
    return line


def test_bad_input_is_one_line(drives, tmp_path, capsys):
    bags, model = drives / "bags", drives / "model.yaml"
    correct = ("correct", "-o", tmp_path / "r", "--model", model)
    assert "no bag matches" in refusal(capsys, *correct, drives / "none*.mcap")
    assert "no bag matches" in refusal(capsys, *correct, tmp_path)
    assert "--model: missing" in refusal(capsys, "correct", "-o", tmp_path / "r", bags)
    assert "no Dask scheduler" in refusal(capsys, *correct, bags, "--scheduler",
                                          "tcp://127.0.0.1:1")
    assert "--map" in refusal(capsys, *correct, bags, "--map", "nowhere:nothing")
    assert "axis" in refusal(capsys, "diagnose", "-o", tmp_path / "r", bags, "--axis", "u")
    table = tmp_path / "table.csv"
    table.write_text("name,lot\na,b\n")
    assert "column" in refusal(capsys, *correct, bags, "--columns", table)
    table.write_text("bag,lot\nother.mcap,b\n")
    assert "tells of none" in refusal(capsys, *correct, bags, "--columns", table)


def test_one_model_for_two_sensors_is_refused(drives, tmp_path, capsys):
    from frac_accel.io.bag import RAW_TOPIC, read_bag, write_bag
    mixed = tmp_path / "mixed"
    mixed.mkdir()
    first, second = sorted((drives / "bags").iterdir())[:2]
    shutil.copy(first, mixed)
    topics = read_bag(second)
    topics[RAW_TOPIC] = topics[RAW_TOPIC]._replace(frame_id="rear_axle")
    write_bag(mixed / "rear.mcap", topics)
    line = refusal(capsys, "correct", mixed, "-o", tmp_path / "r", "--model",
                   drives / "model.yaml", "--workers", "1")
    assert "rear_axle (1" in line and "column model" in line


def test_a_full_disk_ends_the_run_and_keeps_what_is_done(drives, tmp_path, capsys, monkeypatch):
    import errno

    import frac_accel.fleet.store as store
    written = []

    def full(table, file, **_):
        if written:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        written.append(table.num_rows)
        return kept(table, file)
    kept = store.pa.parquet.write_table
    command = ["correct", drives / "bags" / "drive_00*.mcap", "-o", tmp_path / "r", "--model",
               drives / "model.yaml", "--workers", 1]
    with monkeypatch.context() as patched:
        patched.setattr(store, "_TOGETHER", 3)
        patched.setattr(store.pa.parquet, "write_table", full)
        assert "No space left" in refusal(capsys, *command)
    assert len(rows(tmp_path / "r", "correct")) == sum(written) > 0
    assert not list((tmp_path / "r").rglob("*.parquet.partial"))
    assert main(["fleet", *map(str, command)]) == 0
    seen = rows(tmp_path / "r", "correct")
    assert len(seen) == len({entry["sha256"] for entry in seen}) == 10


def test_a_cluster_loses_a_worker(drives, tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None,
                                  silence_logs=50) as cluster:
        killed = threading.Timer(1.0, lambda: os.kill(
            next(iter(cluster.workers.values())).process.process.pid, signal.SIGKILL))
        killed.start()
        assert main(["fleet", "correct", str(drives / "bags"), "-o", str(tmp_path), "--model",
                     str(drives / "model.yaml"), "--scheduler", cluster.scheduler_address]) == 0
        killed.join()
    seen = rows(tmp_path, "correct")
    assert len(seen) == len({entry["sha256"] for entry in seen}) == BAGS
    assert not any(entry["error"] for entry in seen)


def test_workers_of_another_version_are_refused(drives, tmp_path, capsys, monkeypatch):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None,
                                  silence_logs=50) as cluster:
        monkeypatch.setattr(frac_accel, "__version__", "99.0")
        line = refusal(capsys, "correct", drives / "bags", "-o", tmp_path, "--model",
                       drives / "model.yaml", "--scheduler", cluster.scheduler_address)
        assert "99.0" in line
