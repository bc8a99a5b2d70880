"""Feature points of every kind of message."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from ros_logs import KINDS, START, Log, flight, header, times, xyz

from attest import readers, report
from attest.readers import ReadOptions

T = times(10, 10)
CLOUD = "sensor_msgs/msg/PointCloud2"


def read(log, tmp_path, **options):
    return readers.read(log.write(tmp_path), ReadOptions(**options))


def texts(recording):
    return {note.text: note.count for note in recording.notes}


def place(i, k):
    """Where the k-th point is in the i-th message."""
    return np.array([i, k, i - k], np.float64)


def cloud(columns, points, form=np.float32):
    """Return the fields of a cloud of points."""
    rows = np.zeros(len(points), [(name, form if name in "xyz" else "<u4") for name in columns])
    for column, values in zip(columns, np.array(points).T, strict=True):
        rows[column] = values
    data_types = {"<f4": 7, "<f8": 8, "<u4": 6}
    fields = [{"name": name, "offset": rows.dtype.fields[name][1], "count": 1,
               "datatype": data_types[rows.dtype[name].str]} for name in columns]  # fmt: skip
    data = np.frombuffer(rows.tobytes(), np.uint8)
    return {"height": 1, "width": len(rows), "fields": fields, "row_step": rows.nbytes,
            "point_step": rows.itemsize, "data": data}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_poses_in_an_array(tmp_path, kind):
    log = flight(Log(kind))
    for i, t in enumerate(T):
        log.add("/features", "geometry_msgs/msg/PoseArray", t, 5,
                poses=[{"position": xyz(*place(i, k))} for k in range(4)])  # fmt: skip
    recording = read(log, tmp_path)
    for k in range(4):
        signal = recording.signals[f"point{k + 1}"]
        assert_array_equal(signal.y, [place(i, k) for i in range(10)])
        assert_array_equal(signal.t, START + np.array(T))
    described = report.describe(recording)
    assert described["signals"]["point4"]["unit"] == "m"
    assert "feature points from /features: point1 '0', point2 '1'" in str(texts(recording))


@pytest.mark.parametrize("form", [np.float32, np.float64])
def test_a_cloud_of_as_many_points_throughout_hides_those_that_are_nan(tmp_path, form):
    log = flight(Log())
    for i, t in enumerate(T):
        points = [place(i, k) if (i + k) % 3 else [np.nan] * 3 for k in range(3)]
        log.add("/cloud", CLOUD, t, **cloud("xyz", points, form))
    recording = read(log, tmp_path)
    for k in range(3):
        seen = [i for i in range(10) if (i + k) % 3]
        assert_allclose(recording.signals[f"point{k + 1}"].y, [place(i, k) for i in seen])
        assert_array_equal(recording.signals[f"point{k + 1}"].t, START + np.array(T)[seen])
    assert texts(recording)["/cloud point hidden, without a sample"] == 10


@pytest.mark.parametrize("name", ["id", "label"])
def test_a_cloud_may_name_its_points(tmp_path, name):
    log = flight(Log())
    for i, t in enumerate(T):
        seen = [k for k in (7, 12, 3) if k != i]
        points = [[*place(i, k), k] for k in seen[:: -1 if i % 2 else 1]]
        log.add("/cloud", CLOUD, t, **cloud(["x", "y", "z", name], points))
    recording = read(log, tmp_path)
    for number, k in enumerate((3, 7, 12), 1):
        seen = [i for i in range(10) if i != k]
        assert_allclose(recording.signals[f"point{number}"].y, [place(i, k) for i in seen])


def test_clouds_that_are_scans_give_no_points(tmp_path):
    log = flight(Log())
    for t in T:
        log.add("/scan", CLOUD, t, **cloud("xyz", np.zeros((300, 3))))
        log.add("/large", CLOUD, t, **cloud("xyz", np.zeros((6000, 3))))
    for i, t in enumerate(T):
        log.add("/varies", CLOUD, t, **cloud("xyz", np.ones((2 + i, 3))))
    recording = read(log, tmp_path)
    assert not [name for name in recording.signals if name.startswith("point")]
    assert texts(recording)["/large cloud too large for feature points: skipped"] == 10
    assert "/varies has now more, now fewer points and no names for them: not used" in texts(
        recording
    )


@pytest.mark.parametrize("kind", KINDS)
def test_markers_of_a_display(tmp_path, kind):
    log = flight(Log(kind))
    for i, t in enumerate(T):
        seen = [k for k in (2, 10, 1) if k != i]
        markers = [
            {"header": header(t), "id": k, "pose": {"position": xyz(*place(i, k))}, "ns": "f" * i}
            for k in seen
        ]
        gone = {"header": header(t), "id": 2, "action": 2}
        log.add("/marks", "visualization_msgs/msg/MarkerArray", t, 7,
                markers=[gone, *markers] if i == 2 else markers)  # fmt: skip
    recording = read(log, tmp_path)
    for number, k in enumerate((1, 2, 10), 1):
        seen = [i for i in range(10) if i != k]
        signal = recording.signals[f"point{number}"]
        assert_array_equal(signal.y, [place(i, k) for i in seen])
        assert_array_equal(signal.t, START + np.array(T)[seen])


VICON_BRIDGE = {
    "vicon_bridge__Marker": "string marker_name\nstring subject_name\nstring segment_name\n"
    "geometry_msgs/Point translation\nbool occluded\n",
    "vicon_bridge__Markers": "std_msgs/Header header\nuint32 frame_number\n"
    "vicon_bridge/Marker[] markers\n",
}


@pytest.mark.parametrize("kind", KINDS)
def test_markers_of_motion_capture_by_their_own_definitions(tmp_path, kind):
    log = flight(Log(kind, **VICON_BRIDGE))
    for i, t in enumerate(T):
        markers = [
            {
                "marker_name": name,
                "subject_name": "drone",
                "occluded": name == "nose" and i == 4,
                "translation": xyz(*(1000 * place(i, k))),
            }
            for k, name in enumerate(("tail", "nose"), 1)
        ]
        log.add("/vicon/markers", "vicon_bridge/msg/Markers", t, markers=markers)
    recording = read(log, tmp_path)
    seen = [i for i in range(10) if i != 4]
    assert_allclose(recording.signals["point1"].y, [place(i, 2) for i in seen])
    assert_allclose(recording.signals["point2"].y, [place(i, 1) for i in range(10)])
    assert "/vicon/markers in millimetres, by its size" in texts(recording)


MOCAP4R2 = {
    "mocap4r2_msgs__Marker": "int8 USE_NAME=0\nint8 USE_INDEX=1\nint8 USE_BOTH=2\n\nint8 id_type\n"
    "int32 marker_index\nstring marker_name\ngeometry_msgs/Point translation\n",
    "mocap4r2_msgs__Markers": "std_msgs/Header header\nuint32 frame_number\n"
    "mocap4r2_msgs/Marker[] markers\n",
}


@pytest.mark.parametrize("kind", ["mcap", "db3"])
@pytest.mark.parametrize(
    ("form", "names", "called"),
    [
        (0, ({"marker_name": "nose"}, {"marker_name": "tail"}), ("nose", "tail")),
        (0, ({"marker_name": "-5"}, {"marker_name": "--5"}), ("-5", "--5")),
        (1, ({"marker_index": 2}, {"marker_index": 10}), ("2", "10")),
        (
            2,
            ({"marker_index": 5, "marker_name": "a"}, {"marker_index": 4, "marker_name": "b"}),
            ("a", "b"),
        ),
    ],
)
def test_markers_of_mocap4r2_go_by_name_or_index_as_they_say(tmp_path, kind, form, names, called):
    log = flight(Log(kind, **MOCAP4R2))
    for i, t in enumerate(T):
        markers = [{"id_type": form, "translation": xyz(*place(i, k)), **name}
                   for k, name in enumerate(names)][:: -1 if i % 2 else 1]  # fmt: skip
        log.add("/markers", "mocap4r2_msgs/msg/Markers", t, frame_number=i, markers=markers)
    recording = read(log, tmp_path)
    for k in range(2):
        assert_array_equal(recording.signals[f"point{k + 1}"].y, [place(i, k) for i in range(10)])
        assert_array_equal(recording.signals[f"point{k + 1}"].t, START + np.array(T))
    text = f"feature points from /markers: point1 {called[0]!r}, point2 {called[1]!r}"
    assert text in texts(recording)


def test_older_markers_of_mocap4r2_are_read_too(tmp_path):
    definitions = MOCAP4R2 | {
        "mocap4r2_msgs__Marker": "int64 index\ngeometry_msgs/Point translation\n"
    }
    log = flight(Log("mcap", **definitions))
    for i, t in enumerate(T):
        markers = [{"index": k, "translation": xyz(*place(i, k))} for k in (3, 1)]
        log.add("/markers", "mocap4r2_msgs/msg/Markers", t, markers=markers)
    recording = read(log, tmp_path)
    assert_array_equal(recording.signals["point1"].y, [place(i, 1) for i in range(10)])
    assert_array_equal(recording.signals["point2"].y, [place(i, 3) for i in range(10)])


def test_lists_of_vicon_receiver(tmp_path):
    text = "float64[] x\nfloat64[] y\nfloat64[] z\nint32[] indices\nint32 frame_number\n"
    log = flight(Log("mcap", vicon_receiver__MarkersList=text))
    for i, t in enumerate(T):
        seen = [k for k in (7, 2) if k != i][:: -1 if i % 3 else 1]
        x, y, z = 1000.0 * np.array([place(i, k) for k in seen]).T.copy()
        log.add("/vicon/markers", "vicon_receiver/msg/MarkersList", t,
                x=x, y=y, z=z, indices=seen)  # fmt: skip
    recording = read(log, tmp_path)
    for name, k in (("point1", 2), ("point2", 7)):
        seen = [i for i in range(10) if i != k]
        assert_allclose(recording.signals[name].y, [place(i, k) for i in seen])
        assert len(recording.signals[name].t) == 9


def test_markers_of_two_subjects_with_the_same_names_are_told_apart(tmp_path):
    log = flight(Log("bag", **VICON_BRIDGE))
    for i, t in enumerate(T):
        markers = [
            {"marker_name": "m1", "subject_name": subject, "translation": xyz(*place(i, k))}
            for k, subject in enumerate(("ship", "buoy"))
        ]
        stray = [{"translation": xyz(9, 9, 9)}, {"marker_name": "m2", "translation": xyz(8, 8, 8)}]
        log.add("/vicon/markers", "vicon_bridge/msg/Markers", t,
                markers=[*markers, *stray, stray[1]])  # fmt: skip
    recording = read(log, tmp_path)
    assert_array_equal(recording.signals["point1"].y, [place(i, 1) for i in range(10)])
    assert_array_equal(recording.signals["point2"].y, [place(i, 0) for i in range(10)])
    assert sum(name.startswith("point") for name in recording.signals) == 2
    told = texts(recording)
    assert told["/vicon/markers point without a name: not used"] == 10
    assert told["/vicon/markers has several points named 'm2' in one message: dropped"] == 20


def test_points_of_the_topic_that_is_named(tmp_path):
    log = flight(Log())
    for i, t in enumerate(T):
        for topic, count in (("/many", 5), ("/few", 2)):
            log.add(topic, "geometry_msgs/msg/PoseArray", t,
                    poses=[{"position": xyz(*place(i, k))} for k in range(count)])  # fmt: skip
    assert read(log, tmp_path).signals["point5"].source == "/many"
    (tmp_path / "again").mkdir()
    recording = read(log, tmp_path / "again", topics={"points": "/few"})
    assert recording.signals["point1"].source == "/few"
    assert "point3" not in recording.signals
