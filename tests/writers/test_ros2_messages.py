import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from attest.writers import cdr
from attest.writers.ros2_messages import DEFINITIONS, definition

STORE = get_typestore(Stores.ROS2_HUMBLE)


def full(name):
    return name.replace("/", "/msg/")


@pytest.mark.parametrize("name", [name for name in DEFINITIONS if not name.startswith("attest")])
def test_public_definition_is_rosbags_own(name):
    theirs, _ = STORE.generate_msgdef(full(name), ros_version=2)
    assert definition(full(name)).strip() == theirs.strip()


@pytest.mark.parametrize("name", ["attest_msgs/AttitudeError", "attest_msgs/ObserverState"])
def test_own_definition_parses(name):
    types = get_types_from_msg(definition(full(name)), full(name))
    assert full(name) in types
    assert "std_msgs/msg/Header" in types


def test_rows_are_the_bytes_that_rosbags_serialises():
    store = get_typestore(Stores.EMPTY)
    text = "string a\nbool[] b\nfloat64 c\nstring[] d\nint32 e\nfloat64[] f\n"
    store.register(get_types_from_msg(text, "x_msgs/msg/X"))
    fields = (
        *cdr.text("a", "four"),
        *cdr.sequence("b", "u1", 3),
        cdr.Field("c", "<f8", value=1.5),
        *cdr.texts("d", ["", "ü"]),
        cdr.Field("e", "<i4", value=-7),
        *cdr.sequence("f", "<f8", 2),
    )
    rows = cdr.repeat(cdr.row(fields), 2)
    rows["b"], rows["f"] = [True, False, True], [2.5, np.nan]
    message = store.types["x_msgs/msg/X"](
        "four", np.array([True, False, True]), 1.5, ["", "ü"], -7, np.array([2.5, np.nan])
    )
    expected = bytes(store.serialize_cdr(message, "x_msgs/msg/X"))
    assert rows[0].tobytes() == rows[1].tobytes() == expected
