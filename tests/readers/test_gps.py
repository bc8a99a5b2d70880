import numpy as np
import pytest
from numpy.testing import assert_array_equal

from attest.readers import gps
from attest.recording import Signal

SECOND = 10**9
T = np.arange(100) * SECOND // 10


def receiver(fixed, t=T, accuracy=0.0, label="GPS"):
    return gps.Receiver(label, t, np.broadcast_to(fixed, t.shape), np.full(len(t), accuracy))


def vetted(*receivers, source="FILTER"):
    notes = []
    velocity = Signal(T, np.ones((len(T), 3)), source)
    return gps.vetted(velocity, receivers, notes), {note.text: note.count for note in notes}


@pytest.mark.parametrize("receivers", [(), (receiver(True),), (receiver(True, T[:0]),)])
def test_nothing_is_dropped_without_a_reason(receivers):
    signal, notes = vetted(*receivers)
    assert_array_equal(signal.t, T)
    assert notes == {}


def test_one_receiver_of_two_is_enough_for_a_filter_and_none_for_the_other_receiver():
    first, second = receiver(T < 5 * SECOND), receiver(T >= 5 * SECOND, label="GPS2")
    assert len(vetted(first, second)[0].t) == 100
    signal, notes = vetted(first, second, source="GPS")
    assert_array_equal(signal.t, T[:50])
    assert notes == {"GPS velocity without a 3D fix dropped": 50}


def test_a_receiver_without_a_fix_throughout_gives_nothing():
    signal, notes = vetted(receiver(False), source="GPS")
    assert signal is None
    assert notes == {"GPS velocity without a 3D fix dropped": 100}


def test_a_receiver_that_falls_silent_has_no_fix_any_more():
    signal, notes = vetted(receiver(True, T[:20]))
    assert signal.t[-1] == T[19] + gps.SILENT
    assert notes == {"FILTER velocity without a 3D fix dropped": 30}


@pytest.mark.parametrize(
    ("accuracy", "kept"), [(0.0, True), (np.nan, True), (2.0, True), (2.1, False), (np.inf, False)]
)
def test_accuracy_counts_where_it_is_told(accuracy, kept):
    signal, notes = vetted(receiver(True, accuracy=accuracy))
    assert (signal is not None) == kept
    assert notes == ({} if kept else {"FILTER velocity no better than 2 m/s dropped": 100})


def test_a_fix_takes_four_satellites_where_their_number_is_known():
    kind, satellites = np.array([2, 3, 3, 3, 6]), np.array([9, 0, 3, 4, 12])
    assert gps.fixed(kind, satellites).tolist() == [False, True, False, True, True]
    assert gps.fixed(kind, None).tolist() == [False, True, True, True, True]
