"""The CDR code agrees with `rosbags`' independent serialiser, and survives hostile bytes."""

from pathlib import Path

import numpy as np
import pytest

from frac_accel.errors import BagError
from frac_accel.io import cdr, message_definitions
from frac_accel.io.samples import Samples

typesys = pytest.importorskip("rosbags.typesys", reason="a reader of its own to compare with")

STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
TYPES = STORE.types
FRAMES = ["", "a", "imu", "accel_link", "x" * 37, "ümläut"]


def header(rng, frame_id):
    stamp = TYPES["builtin_interfaces/msg/Time"](
        int(rng.integers(-(2**31), 2**31)), int(rng.integers(0, 10**9))
    )
    return TYPES["std_msgs/msg/Header"](stamp, frame_id)


def vector(rng):
    return TYPES["geometry_msgs/msg/Vector3"](*rng.normal(size=3))


def message(rng, type_name, frame_id):
    if type_name == cdr.IMU:
        return TYPES[type_name](
            header(rng, frame_id),
            TYPES["geometry_msgs/msg/Quaternion"](*rng.normal(size=4)),
            rng.normal(size=9),
            vector(rng),
            rng.normal(size=9),
            vector(rng),
            rng.uniform(1, 2, size=9),
        )
    if type_name == cdr.ACCEL_STAMPED:
        accel = TYPES["geometry_msgs/msg/Accel"](vector(rng), vector(rng))
        return TYPES[type_name](header(rng, frame_id), accel)
    return TYPES[type_name](header(rng, frame_id), *rng.uniform(1, 2, size=2))


def serialised(type_name, ros_message, little_endian=True):
    data = STORE.serialize_cdr(ros_message, type_name, little_endian=little_endian)
    return bytes(data)


def stamp_ns(ros_message):
    return ros_message.header.stamp.sec * 10**9 + ros_message.header.stamp.nanosec


def linear(ros_message):
    part = getattr(ros_message, "accel", None)
    part = part.linear if part else ros_message.linear_acceleration
    return [part.x, part.y, part.z]


@pytest.mark.parametrize("little_endian", [True, False])
@pytest.mark.parametrize("frame_id", FRAMES)
@pytest.mark.parametrize("type_name", cdr.SAMPLE_TYPES)
def test_reads_what_rosbags_serialises(type_name, frame_id, little_endian):
    rng = np.random.default_rng(len(frame_id))
    truth = [message(rng, type_name, frame_id) for _ in range(5)]
    samples = cdr.read_samples(type_name, [serialised(type_name, m, little_endian) for m in truth])
    assert samples.stamps_ns.tolist() == [stamp_ns(m) for m in truth]
    assert samples.values.tolist() == [linear(m) for m in truth]
    assert samples.frame_id == frame_id
    if type_name == cdr.IMU:
        diagonals = [m.linear_acceleration_covariance[[0, 4, 8]].tolist() for m in truth]
        assert samples.variance.tolist() == diagonals
    else:
        assert np.isnan(samples.variance).all()


def test_unknown_covariances_are_nan():
    rng = np.random.default_rng(3)
    known, zero, refused = (message(rng, cdr.IMU, "imu") for _ in range(3))
    zero.linear_acceleration_covariance[:] = 0
    refused.linear_acceleration_covariance[0] = -1
    messages = [serialised(cdr.IMU, m) for m in (known, zero, refused)]
    unknown = np.isnan(cdr.read_samples(cdr.IMU, messages).variance)
    assert unknown.tolist() == [[False] * 3, [True] * 3, [True] * 3]


@pytest.mark.parametrize("type_name", cdr.SAMPLE_TYPES)
def test_mixed_layouts_are_read_one_by_one(type_name):
    rng = np.random.default_rng(4)
    truth = [message(rng, type_name, frame) for frame in FRAMES + ["abc", "xyz"] + FRAMES]
    data = [serialised(type_name, m, i % 3 > 0) for i, m in enumerate(truth)]
    samples = cdr.read_samples(type_name, data)
    assert samples.stamps_ns.tolist() == [stamp_ns(m) for m in truth]
    assert samples.values.tolist() == [linear(m) for m in truth]


@pytest.mark.parametrize("type_name", cdr.SAMPLE_TYPES)
@pytest.mark.parametrize("frames", [["imu"] * 6, FRAMES])
def test_patching_changes_stamp_acceleration_and_diagonal_only(type_name, frames):
    rng = np.random.default_rng(5)
    truth = [message(rng, type_name, frame) for frame in frames]
    data = [serialised(type_name, m, frames[0] == "imu" or i % 2 == 0) for i, m in enumerate(truth)]
    stamps = rng.integers(0, 2**60, size=len(truth))
    values = rng.normal(size=(len(truth), 3))
    variance = rng.uniform(1, 2, size=(len(truth), 3))
    variance[1, 2] = np.nan
    patched = cdr.patch_samples(type_name, data, stamps, values, variance)
    one_by_one = [cdr.patch_samples(type_name, *([part] for part in row))
                  for row in zip(data, stamps, values, variance)]
    assert [[one] for one in patched] == one_by_one
    for before, after, ros_message, i in zip(data, patched, truth, range(len(truth))):
        ros_message.header.stamp.sec, ros_message.header.stamp.nanosec = divmod(
            int(stamps[i]), 10**9
        )
        part = getattr(ros_message, "accel", None)
        part = part.linear if part else ros_message.linear_acceleration
        part.x, part.y, part.z = values[i].tolist()
        if type_name == cdr.IMU:
            known = ~np.isnan(variance[i])
            diagonal = np.array([0, 4, 8])[known]
            ros_message.linear_acceleration_covariance[diagonal] = variance[i][known]
        assert after == serialised(type_name, ros_message, before[1] == 1)


@pytest.mark.parametrize("little_endian", [True, False])
@pytest.mark.parametrize("type_name", cdr.SAMPLE_TYPES)
def test_a_few_messages_are_treated_as_many(type_name, little_endian):
    rng = np.random.default_rng(7)
    truth = [message(rng, type_name, "imu") for _ in range(24)]
    if type_name == cdr.IMU:
        for i, covariance in enumerate([[0] * 9, [-1] + [0] * 8, [0] * 8 + [1], [np.nan] * 9]):
            truth[i].linear_acceleration_covariance = np.array(covariance, float)
    data = [serialised(type_name, one, little_endian) for one in truth]
    many = cdr.read_samples(type_name, data)
    few = Samples.concatenate([cdr.read_samples(type_name, data[i:i + 2])
                               for i in range(0, len(data), 2)])
    for one, other in zip(few, many):
        np.testing.assert_array_equal(one, other)
    stamps, values = rng.integers(0, 2**60, size=len(data)), rng.normal(size=(len(data), 3))
    variance = rng.uniform(1, 2, size=(len(data), 3))
    variance[3, 1] = np.nan
    assert cdr.replace_samples(type_name, data, stamps, values, variance) == [
        patched for i in range(0, len(data), 3) for patched in cdr.replace_samples(
            type_name, data[i:i + 3], stamps[i:i + 3], values[i:i + 3], variance[i:i + 3])]
    with pytest.raises(BagError, match="time stamp"):
        cdr.replace_samples(type_name, data[:1], [2**62], values[:1], variance[:1])


@pytest.mark.parametrize("type_name", cdr.SAMPLE_TYPES)
@pytest.mark.parametrize("frame_id", FRAMES)
def test_a_message_can_have_another_frame(type_name, frame_id):
    for i, before in enumerate(FRAMES):
        ros_message = message(np.random.default_rng(i), type_name, before)
        data = serialised(type_name, ros_message, i % 2 == 0)
        ros_message.header.frame_id = frame_id
        assert cdr.with_frame(data, frame_id) == serialised(type_name, ros_message, i % 2 == 0)


def random_samples(rng, count, frame_id="accel_link"):
    stamps = 1_700_000_000 * 10**9 + np.cumsum(rng.integers(1, 10**7, size=count))
    variance = rng.uniform(0.1, 1, size=(count, 3))
    return Samples.of(stamps, rng.normal(size=(count, 3)), variance, frame_id)


@pytest.mark.parametrize("type_name", cdr.SAMPLE_TYPES)
@pytest.mark.parametrize("frame_id", FRAMES)
def test_rosbags_reads_what_we_encode(type_name, frame_id):
    samples = random_samples(np.random.default_rng(6), 4, frame_id)
    for i, data in enumerate(cdr.encode_samples(type_name, samples)):
        ros_message = STORE.deserialize_cdr(data, type_name)
        assert serialised(type_name, ros_message) == data
        assert stamp_ns(ros_message) == samples.stamps_ns[i]
        assert linear(ros_message) == samples.values[i].tolist()
        assert ros_message.header.frame_id == frame_id
        if type_name == cdr.IMU:
            assert ros_message.orientation_covariance.tolist() == [-1.0] + [0.0] * 8
            assert ros_message.angular_velocity_covariance.tolist() == [-1.0] + [0.0] * 8
            assert ros_message.orientation.w == 1.0
            covariance = np.diag(samples.variance[i]).ravel()
            assert ros_message.linear_acceleration_covariance.tolist() == covariance.tolist()


@pytest.mark.parametrize("frame_id", FRAMES)
def test_point_cloud_blocks(frame_id):
    samples = random_samples(np.random.default_rng(7), 100, frame_id)
    data = cdr.encode_point_cloud(samples)
    cloud = STORE.deserialize_cdr(data, cdr.POINT_CLOUD2)
    assert serialised(cdr.POINT_CLOUD2, cloud) == data
    assert (cloud.height, cloud.width, [f.name for f in cloud.fields]) == (1, 100, list("txyz"))
    for little_endian in (True, False):
        again = cdr.read_samples(
            cdr.POINT_CLOUD2, [serialised(cdr.POINT_CLOUD2, cloud, little_endian)] * 2
        )
        assert again.stamps_ns.tolist() == samples.stamps_ns.tolist() * 2
        assert again.values.tolist() == samples.values.tolist() * 2
        assert again.frame_id == frame_id


@pytest.mark.parametrize(
    "change, says",
    [
        ({"height": 2}, "height 2"),
        ({"width": 101}, "101 points"),
        ({"point_step": 16}, "FLOAT64"),
        ({"fields": []}, "no field 't'"),
    ],
)
def test_point_clouds_that_are_no_blocks(change, says):
    samples = random_samples(np.random.default_rng(8), 100)
    cloud = STORE.deserialize_cdr(cdr.encode_point_cloud(samples), cdr.POINT_CLOUD2)
    for name, value in change.items():
        object.__setattr__(cloud, name, value)
    with pytest.raises(BagError, match=says):
        cdr.read_point_cloud(serialised(cdr.POINT_CLOUD2, cloud))


def read_temperatures(messages):
    """Of messages that follow each other in a buffer, as in a bag."""
    lengths = np.array([len(one) for one in messages])
    return cdr.read_temperatures_at(b"".join(messages), np.cumsum(lengths) - lengths, lengths)


def test_temperatures():
    rng = np.random.default_rng(9)
    truth = [message(rng, cdr.TEMPERATURE, frame) for frame in ("a", "a", "abc", "")]
    truth[1].variance = 0.0
    data = [serialised(cdr.TEMPERATURE, m) for m in truth]
    read = read_temperatures(data)
    assert read.stamps_ns.tolist() == [stamp_ns(m) for m in truth]
    assert read.celsius.tolist() == [m.temperature for m in truth]
    assert np.isnan(read.variance).tolist() == [False, True, False, False]
    ours = cdr.encode_temperature(stamp_ns(truth[0]), truth[0].temperature, truth[0].variance, "a")
    assert ours == data[0]


@pytest.mark.parametrize("type_name", [*cdr.ACCELERATION_TYPES, cdr.TEMPERATURE])
def test_hostile_bytes_raise_bag_errors_only(type_name):
    rng = np.random.default_rng(10)
    samples = random_samples(rng, 3)
    if type_name == cdr.POINT_CLOUD2:
        whole = cdr.encode_point_cloud(samples)
    else:
        whole = serialised(type_name, message(rng, type_name, "imu"))

    def read(data):
        try:
            if type_name == cdr.TEMPERATURE:
                read_temperatures([data, whole])
            else:
                cdr.read_samples(type_name, [data, whole])
                if type_name != cdr.POINT_CLOUD2:
                    cdr.patch_samples(type_name, [data], [0], [(1, 2, 3)], [(1, 2, 3)])
        except BagError:
            return False
        return True

    needed = len(whole) - (type_name == cdr.POINT_CLOUD2)  # its last byte, is_dense, is not read
    assert [read(whole[:size]) for size in range(needed)] == [False] * needed
    assert read(whole)
    for _ in range(2000):
        damaged = bytearray(whole)
        for at in rng.integers(0, min(len(whole), 120), size=rng.integers(1, 4)):
            damaged[at] = rng.integers(0, 256)
        read(bytes(damaged))
        read(rng.bytes(int(rng.integers(0, 400))))


def test_stamps_out_of_range_are_refused():
    samples = Samples.of([2**31 * 10**9], np.zeros((1, 3)))
    with pytest.raises(BagError, match="time stamp"):
        cdr.encode_samples(cdr.IMU, samples)


OWN_TYPES = [*cdr.ACCELERATION_TYPES, cdr.TEMPERATURE]


@pytest.mark.parametrize("type_name", OWN_TYPES)
def test_definitions_and_hashes_agree_with_rosbags(type_name):
    definition = message_definitions.find_definition(type_name)
    assert definition.type_hash == STORE.hash_rihs01(type_name)
    from rosbags.typesys import get_types_from_msg

    parsed = get_types_from_msg(definition.text, type_name)
    for name, fields in parsed.items():
        assert fields[1] == STORE.fielddefs[name][1], name
    assert type_name in parsed


def test_definition_of_an_unknown_type_is_empty():
    assert message_definitions.find_definition("no_such_pkg/msg/Thing") == ("", "")
    assert message_definitions.find_definition("../../etc/passwd") == ("", "")


def test_definitions_from_an_ament_prefix(tmp_path: Path, monkeypatch):
    folder = tmp_path / "share" / "my_msgs" / "msg"
    folder.mkdir(parents=True)
    (folder / "Outer.msg").write_text("Inner[<=3] inner  # Other other\nstd_msgs/Header header\n")
    (folder / "Inner.msg").write_text("uint8 A=1\nstring<=5 text\nfloat64[9] values\n")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    text = message_definitions.find_definition("my_msgs/msg/Outer").text
    names = [line for line in text.splitlines() if line.startswith("MSG: ")]
    assert names == ["MSG: my_msgs/Inner", "MSG: std_msgs/Header", "MSG: builtin_interfaces/Time"]
    (folder / "Inner.msg").unlink()
    assert message_definitions.find_definition("my_msgs/msg/Outer").text == ""
