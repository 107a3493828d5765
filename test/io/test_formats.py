"""Other people's formats are read as the same samples, and written so that these come back.

What is read here is written by the formats' own libraries, not by the package.
"""

import csv
import datetime
import sqlite3
from pathlib import Path

import numpy as np
import pytest
from bag_fixtures import START_NS, assert_equal, random_samples

from frac_accel import read_bag, write_bag
from frac_accel.cli import main
from frac_accel.errors import BagError
from frac_accel.io import cdr, formats
from frac_accel.io.bag import BagReader, BagWriter, Temperatures, read_temperature

for library in ("pyarrow", "asammdf", "rosbags"):
    pytest.importorskip(library, reason="the extra `formats` is in .venv only")

TOPICS = {"/imu/reference": random_samples(1, 300, "reference_link"),
          "/imu/data_raw": random_samples(2, 420)}
HEAT = Temperatures(START_NS + np.arange(5) * 10**8, np.linspace(20, 31, 5), np.full(5, 0.25),
                    "imu_link")
G = 9.80665


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp("bag") / "bag.mcap"
    write_bag(path, {**TOPICS, "/imu/temperature": HEAT})
    return path


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("end", ["csv", "parquet", "npz", "mf4", "db3", "mcap"])
def test_there_and_back(end, bag, folder, capsys):
    assert main(["convert", str(bag), "-o", f"there.{end}"]) == 0
    assert main(["convert", f"there.{end}", "-o", "back.mcap"]) == 0
    assert "300 messages of /imu/reference" in capsys.readouterr().out
    for path in (f"there.{end}", "back.mcap"):
        heat = read_temperature(path)
        np.testing.assert_array_equal(heat.stamps_ns, HEAT.stamps_ns)
        np.testing.assert_array_equal(heat.celsius, HEAT.celsius)
        np.testing.assert_array_equal(heat.variance, HEAT.variance)
        found = read_bag(path)
        assert found.keys() == TOPICS.keys()
        for topic, samples in TOPICS.items():
            assert_equal(found[topic], samples)


@pytest.mark.parametrize("end", ["csv", "parquet", "npz", "mf4"])
@pytest.mark.parametrize("symmetric", [True, False])
def test_a_covariance_that_is_not_diagonal_comes_back_whole(end, symmetric, folder):
    rng = np.random.default_rng(6)
    covariance = rng.uniform(0.1, 1.0, (50, 3, 3))
    if symmetric:
        covariance = covariance @ covariance.transpose(0, 2, 1)
    covariance[7] = 0.0  # unknown
    samples = random_samples(5, 50, "<seat> & rail")
    messages = [bytearray(message) for message in cdr.encode_samples(cdr.IMU, samples)]
    for message, own in zip(messages, covariance):
        message[-72:] = own.astype("<f8").tobytes()
    with BagWriter("bag.mcap") as writer:
        writer.add_topic("/imu/data_raw", cdr.IMU)
        for message, stamp in zip(messages, samples.stamps_ns.tolist()):
            writer.write("/imu/data_raw", bytes(message), stamp)
    write_bag("diagonal.mcap", {"/imu/data_raw": random_samples(5, 50)})
    assert main(["convert", "bag.mcap", "-o", f"there.{end}"]) == 0
    assert main(["convert", f"there.{end}", "-o", "back.mcap"]) == 0
    back = [message.data for message in BagReader("back.mcap").messages()]
    found = cdr.read_covariances(back)
    np.testing.assert_array_equal(found, covariance.reshape(50, 9))
    assert_equal(read_bag("back.mcap")["/imu/data_raw"], read_bag("bag.mcap")["/imu/data_raw"])
    # three more columns, or six; none where the diagonal is all
    assert main(["convert", "diagonal.mcap", "-o", "diagonal.csv"]) == 0
    assert "covariance" not in (folder / "diagonal.csv").read_text()
    if end == "csv":
        names = (folder / "there.csv").read_text().partition("\n")[0]
        assert names.count("covariance_") == (3 if symmetric else 6)


def test_a_database_of_rosbag2_keeps_every_message(folder, bag):
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore
    store = get_typestore(Stores.ROS2_JAZZY)
    messages = list(BagReader(bag).messages())
    with Writer(folder / "recorded", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        text = writer.add_connection("/note", "std_msgs/msg/String", typestore=store)
        writer.write(text, START_NS, b"\x00\x01\x00\x00\x02\x00\x00\x00a\x00")
        known = {info.name: writer.add_connection(info.name, info.type_name, typestore=store)
                 for info in BagReader(bag).topics.values()}
        for message in messages:
            writer.write(known[message.topic], message.log_time_ns, message.data)
    bare, = (folder / "recorded").glob("*.db3")
    for path in (folder / "recorded", bare):
        reader = BagReader(path)
        assert reader.topics["/note"].type_name == "std_msgs/msg/String"
        read = [m[:3] for m in reader.messages() if m.topic != "/note"]
        assert sorted(read) == sorted(m[:3] for m in messages)
    # and what we write is a database that others read
    assert main(["convert", str(folder / "recorded"), "-o", "ours.db3"]) == 0
    with sqlite3.connect("ours.db3") as database:
        count, = database.execute("SELECT count(*) FROM messages").fetchone()
    assert count == len(messages) + 1


def test_a_compressed_bag_of_rosbag2(folder, bag):
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    info = BagReader(bag).topics["/imu/data_raw"]
    writer = Writer(folder / "small", version=9, storage_plugin=StoragePlugin.SQLITE3)
    writer.set_compression(CompressionMode.FILE, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection(info.name, info.type_name, rihs01="RIHS01_" + "0" * 64,
                                           msgdef=info.schema_text.decode())
        for message in BagReader(bag).messages([info.name]):
            writer.write(connection, message.log_time_ns, message.data)
    assert_equal(read_bag(folder / "small")["/imu/data_raw"], TOPICS["/imu/data_raw"])


def values(count=40):
    return np.random.default_rng(3).normal(size=(count, 3)).round(6)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252"])
def test_csv_of_a_german_instrument(encoding, folder):
    """Semicolons, decimal commas, remarks before the names, units in the second line."""
    rows = values()
    lines = ["# Messung 7", "Zeit;Referenz;Ax;Ay", "s;m/s²;g;g"]
    lines += [";".join(f"{x:.6f}".replace(".", ",") for x in (0.01 * i, *row))
              for i, row in enumerate(rows)]
    (folder / "m.csv").write_text("\n".join(lines) + "\n", encoding=encoding)
    assert main(["convert", "m.csv", "-o", "m.mcap", "--time", "Zeit",
                 "--map", "/imu/reference=Referenz", "--map", "/imu/data_raw=Ax,-,Ay"]) == 0
    found = read_bag("m.mcap")
    np.testing.assert_array_equal(found["/imu/data_raw"].stamps_ns, np.arange(40) * 10**7)
    np.testing.assert_allclose(found["/imu/reference"].values[:, 0], rows[:, 0], rtol=1e-12)
    np.testing.assert_allclose(found["/imu/data_raw"].values[:, [0, 2]], G * rows[:, 1:],
                               rtol=1e-12)
    assert not found["/imu/data_raw"].values[:, 1].any()


def test_csv_with_topics_of_two_rates_in_one_table(folder):
    """As PlotJuggler exports it: a row for each instant, empty cells where a topic has none."""
    rows = values(60)
    with open("two.csv", "w", newline="") as file:
        writer = csv.writer(file)
        names = [f"/{topic}/linear_acceleration/{axis}" for topic in ("fast", "slow")
                 for axis in "xyz"]
        writer.writerow(["__time", *(f"{name} [m/s^2]" for name in names)])
        for i, row in enumerate(rows):
            writer.writerow([1.7e9 + i / 64, *row, *(row if i % 3 == 0 else [""] * 3)])
    found = read_bag("two.csv")
    np.testing.assert_array_equal(found["/fast"].values, rows)
    np.testing.assert_array_equal(found["/slow"].values, rows[::3])
    np.testing.assert_array_equal(np.diff(found["/slow"].stamps_ns), 46_875_000)


def test_two_files_become_one_record(folder):
    np.save("reference.npy", values())
    with open("phone.csv", "w", newline="") as file:
        csv.writer(file).writerows([["time_ms", "x", "y", "z"],
                                    *([10 * i, *row] for i, row in enumerate(values(30)))])
    assert main(["convert", "/imu/reference=reference.npy", "-o", "r.mcap", "--rate", "250",
                 "--unit", "mg"]) == 0
    assert main(["convert", "r.mcap", "/imu/data_raw=phone.csv", "-o", "both.mcap", "--unit",
                 "g"]) == 0
    found = read_bag("both.mcap")
    np.testing.assert_array_equal(found["/imu/reference"].stamps_ns, np.arange(40) * 4_000_000)
    np.testing.assert_allclose(found["/imu/reference"].values, 1e-3 * G * values())
    np.testing.assert_array_equal(found["/imu/data_raw"].stamps_ns, np.arange(30) * 10_000_000)


def test_measurement_of_a_vehicle_bus(folder):
    """MDF4 by asammdf: two channel groups, raw counts with a conversion, an absolute start."""
    from asammdf import MDF, Signal
    begin = datetime.datetime(2026, 3, 1, 12, tzinfo=datetime.timezone.utc)
    mdf = MDF(version="4.10")
    mdf.header.start_time = begin
    slow, fast = np.arange(50) * 0.1, np.arange(200) * 0.02
    counts = np.arange(-25, 25, dtype=np.int16)
    mdf.append([Signal(counts, slow, name="LongAccel", unit="m/s^2",
                       conversion={"a": 0.01, "b": 0.0})])
    mdf.append([Signal(np.sin(fast), fast, name="AccX", unit="g")])
    mdf.save("drive.mf4", overwrite=True)
    assert main(["convert", "drive.mf4", "-o", "drive.mcap", "--map", "/imu/reference=LongAccel",
                 "--map", "/imu/data_raw=AccX"]) == 0
    found = read_bag("drive.mcap")
    start = round(begin.timestamp()) * 10**9
    np.testing.assert_allclose(found["/imu/reference"].values[:, 0], 0.01 * counts)
    np.testing.assert_allclose(found["/imu/data_raw"].values[:, 0], G * np.sin(fast))
    np.testing.assert_array_equal(found["/imu/data_raw"].stamps_ns,
                                  start + np.arange(200) * 20_000_000)


def test_parquet_of_a_data_lake(folder):
    import pyarrow
    from pyarrow import parquet
    stamps = np.datetime64(START_NS, "ns") + np.arange(40) * np.timedelta64(1234567, "ns")
    field = pyarrow.field("x", pyarrow.float64(), metadata={"unit": "g"})
    table = pyarrow.table([pyarrow.array(stamps), pyarrow.array(values()[:, 0])],
                          schema=pyarrow.schema([("timestamp", pyarrow.timestamp("ns")), field]))
    parquet.write_table(table, "lake.parquet")
    found = read_bag("lake.parquet")["/imu/data_raw"]
    np.testing.assert_array_equal(found.stamps_ns, START_NS + np.arange(40) * 1234567)
    np.testing.assert_allclose(found.values[:, 0], G * values()[:, 0])


def test_commands_take_a_table_as_it_is(folder, capsys):
    from frac_accel.paper import BAGS
    source = BAGS / "classical_bench.mcap"
    assert main(["convert", str(source), "-o", "bench.parquet"]) == 0
    capsys.readouterr()
    model = str(source.with_suffix(".yaml"))
    for bag in (str(source), "bench.parquet"):
        assert main(["validate", bag, "--model", model]) == 0
    one, two = np.array_split(capsys.readouterr().out.splitlines(), 2)
    assert one.tolist() == two.tolist()
    assert main(["identify", "bench.parquet", "-o", "m.yaml", "--json", "m.json"]) == 0
    assert main(["correct", "bench.parquet", "--model", "m.yaml", "-o", "c.mcap"]) == 0


REFUSED = [
    ("0.0,0.1,0.2,9.81\n0.01,0.1,0.2,9.81\n", ["--unit", "g"],
     "first line holds numbers, not names of columns"),
    ("time [s],ax,ay\n0,1,2\n", [], "frac_accel convert FILE"),
    ("time [s],x,y\n0,1,2\n", [], "column 'x' states no unit"),
    ("time,x [g]\n0,1\n", [], "column 'time' states no unit"),
    ("x [g]\n1\n", [], "--rate HZ"),
    ("time [s],x [furlong]\n0,1\n", [], "unit 'furlong' is not known"),
    ("time [h],x [g]\n0,1\n", [], "expected s, ms, us or ns"),
    ("time [s],x [g]\n0,one\n1,two\n", [], "column 'x' holds 'one', expected numbers"),
    ("time [s],x [g]\n0,1\n1,two\n", [], "column 'x' holds 'two', expected numbers"),
    ("time [s],x [g]\n", [], "has no rows with values for /imu/data_raw"),
    ("time [s],x [g],x [mg]\n0,1,2\n", [], "two columns are named 'x': rename one"),
    ("time [s],x [g]\n0,\x81\n", [], "is no text, neither in UTF-8 nor in cp1252"),
    ("time [s],x [g]\n0,1\n,2\n", [], "no time in row 1"),
    ("time [s],x [g]\n0,1\n1,2,3\n", [], "Expected 2 columns, got 3"),
    ("time [s],x [g]\n1e300,1\n", [], "no stamp can hold"),
    ("", [], "is empty"),
    ("time [s],a\n0,1\n", ["--map", "/imu/reference=b", "--unit", "g"],
     "no column 'b' for /imu/reference, but"),
    ("time [s],a\n0,1\n", ["--map", "/imu/reference=a,b,c,d"], "expected /TOPIC=X"),
    ("time [s],a\n0,1\n", ["--map", "/imu/reference=a", "--time", "t"], "no column 't'"),
]


@pytest.mark.parametrize("text, options, words", REFUSED)
def test_refusals_are_one_line(text, options, words, folder, capsys):
    (folder / "in.csv").write_bytes(text.encode("latin-1"))
    try:
        status = main(["convert", "in.csv", "-o", "out.mcap", *options])
    except SystemExit as stopped:
        status = stopped.code
    assert status == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert words in line
    assert [path.name for path in folder.iterdir()] == ["in.csv"]


@pytest.mark.parametrize("name", ["in.mf4", "in.npz", "in.npy", "in.parquet", "in.db3", "in.xlsx"])
def test_damaged_files_are_refused_in_one_line(name, folder, capsys):
    rng = np.random.default_rng(1)
    head = b"SQLite format 3\0" if name.endswith("db3") else b""
    (folder / name).write_bytes(head + rng.bytes(3000))
    assert main(["correct", name, "--model", "m.yaml", "-o", "out.mcap"]) == 2
    capsys.readouterr()
    assert main(["convert", name, "-o", "out.mcap"]) == 2
    line, = capsys.readouterr().err.splitlines()
    assert name in line and "nobody has foreseen" not in line


@pytest.mark.parametrize("end", ["csv", "parquet", "npz", "mf4", "db3"])
def test_damage_is_one_line_or_none(end, folder, capfd):
    """Cut off, or with bytes changed: what cannot be read is refused, and nothing else is said."""
    write_bag("whole.mcap", {"/imu/data_raw": random_samples(5, 60)})
    assert main(["convert", "whole.mcap", "-o", f"whole.{end}"]) == 0
    whole = (folder / f"whole.{end}").read_bytes()
    # each MDF file is read in a process of its own
    for seed in range(12 if end == "mf4" else 40):
        rng = np.random.default_rng(seed)
        damaged = np.frombuffer(whole, np.uint8).copy()
        if seed % 3:
            places = rng.integers(len(whole), size=(1, 5, 50)[seed % 3])
            damaged[places] = rng.integers(256, size=len(places))
        else:
            damaged = damaged[:rng.integers(len(whole))]
        (folder / f"in.{end}").write_bytes(damaged.tobytes())
        capfd.readouterr()
        assert main(["convert", f"in.{end}", "-o", "out.mcap"]) in (0, 2)
        assert len(capfd.readouterr().err.splitlines()) <= 1


def test_a_file_that_ends_its_reader_is_refused(folder, monkeypatch, capfd):
    """As some damaged MDF files do in asammdf's compiled part."""
    import os
    import signal

    from frac_accel.io.formats import mdf
    (folder / "in.mf4").write_bytes(b"MDF     4.10    ")
    monkeypatch.setattr(mdf, "_read", lambda path: os.kill(os.getpid(), signal.SIGSEGV))
    assert main(["convert", "in.mf4", "-o", "out.mcap"]) == 2
    line, = capfd.readouterr().err.splitlines()
    assert "in.mf4: cannot be read: it is damaged" in line


@pytest.mark.parametrize("end", ["npz", "parquet"])
def test_small_files_that_unpack_to_too_much_are_refused(end, folder, monkeypatch):
    import pyarrow
    from pyarrow import parquet
    monkeypatch.setattr("frac_accel.io.formats.columns._UNSUSPECTED_BYTES", 2**20)
    nothing = np.zeros(10**6)
    if end == "npz":
        np.savez_compressed("in.npz", **{"time_s": nothing, "x [g]": nothing})
    else:
        parquet.write_table(pyarrow.table({"time_s": nothing, "x [g]": nothing}), "in.parquet")
    with pytest.raises(BagError, match="unpacks to 16000"):
        read_bag(f"in.{end}")


def test_arrays_of_no_real_numbers_are_refused(folder, capsys):
    np.save("in.npy", np.ones(3, complex))
    assert main(["convert", "in.npy", "-o", "out.mcap", "--unit", "g", "--rate", "9"]) == 2
    assert "holds (1+0j), expected numbers" in capsys.readouterr().err
    np.save("in.npy", np.array([{}], object), allow_pickle=True)
    assert main(["convert", "in.npy", "-o", "out.mcap", "--unit", "g", "--rate", "9"]) == 2
    err = capsys.readouterr().err
    assert "Python objects, which are never read" in err and "allow_pickle" not in err


@pytest.mark.parametrize("command", ["correct", "simulate"])
def test_a_bag_is_not_written_under_the_name_of_another_format(command, folder, capsys):
    """A folder called ``out.csv`` was made."""
    bags = Path(__file__).parents[2] / "bags"
    assert main([command, str(bags / "classical_bench.mcap"), "--model",
                 str(bags / "classical_bench.yaml"), "-o", "out.csv"]) == 2
    assert "frac_accel convert makes a .csv of one" in capsys.readouterr().err
    assert not list(folder.iterdir())


def test_formats_that_cannot_be_written_are_refused(bag, folder, capsys):
    for name in ("out.xlsx", "out.npy"):
        assert main(["convert", str(bag), "-o", name]) == 2
        assert ".parquet" in capsys.readouterr().err
    assert main(["convert", str(bag), str(bag), "-o", "out.mcap"]) == 2
    assert "is in two of the inputs" in capsys.readouterr().err
    assert not list(folder.iterdir())


def test_a_missing_library_is_named(folder, monkeypatch):
    (folder / "in.csv").write_text("time [s],x [g]\n0,1\n")
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(BagError, match=r"needs the Python library pyarrow: pip install "
                                       r"'frac_accel\[formats\]'"):
        read_bag("in.csv")


def test_what_a_table_cannot_hold_is_said(folder, capsys):
    with BagWriter("bag.mcap") as writer:
        writer.add_topic("/note", "std_msgs/msg/String")
        writer.add_topic("/imu/data_raw", cdr.IMU)
        writer.write("/note", b"\x00\x01\x00\x00\x01\x00\x00\x00\x00", 5)
        for message in cdr.encode_samples(cdr.IMU, TOPICS["/imu/data_raw"]):
            writer.write("/imu/data_raw", message, 6)
    assert main(["convert", "bag.mcap", "-o", "table.csv"]) == 0
    assert "left out: /note" in capsys.readouterr().out


def test_what_was_made_for_reading_goes_with_the_process(folder):
    import subprocess
    import sys
    (folder / "in.csv").write_text("time [s],x [g]\n0,1\n")
    shown = subprocess.run([sys.executable, "-c", "from frac_accel.io import formats; "
                            "path = formats.as_mcap('in.csv'); assert path.exists(); print(path)"],
                           capture_output=True, text=True, check=True).stdout.strip()
    assert shown.endswith(".mcap")
    assert not formats.Path(shown).parent.exists()
