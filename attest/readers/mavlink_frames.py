"""The frames in a stretch of bytes: found through damage, and checked.

A sound log is a chain: each frame ends where the next one's stamp begins. So a mark that leads to
another mark is tried first; what that leaves uncovered is damage or foreign messages. A gap that
headers bridge from end to end holds frames that are damaged inside, or of an unknown message;
in any other gap every mark is tried.
"""

import numpy as np

from attest.readers import mavlink
from attest.readers.mavlink import Bytes, Frames, Ints, Mask

MARGIN = 4 * (mavlink.LONGEST + 8)
"""Frames that end so close to the end of a block are left to the next one."""
MARKS = 1 << 19
"""The most places where a frame could begin that are looked at together: bounds the memory."""
BRIDGE = 64
"""The most frames without a right checksum between two with one."""


def checked_frames(buffer: Bytes) -> Frames:
    """Every frame with a right checksum, though frames may overlap."""
    at = np.flatnonzero(mavlink.marks(buffer[: max(0, len(buffer) - 7)]))
    end = mavlink.ends(buffer, at)
    inside = (end > 0) & (end <= len(buffer))
    return _checked(buffer, at[inside], end[inside])


def _checked(buffer: Bytes, at: Ints, end: Ints) -> Frames:
    frames = mavlink.headers(buffer, at, end)
    frames = frames.where(mavlink.known(frames.number))
    return frames.where(mavlink.valid(buffer, frames))


def sound_frames(buffer: Bytes, stamp: int) -> Frames:
    """Find sound frames by halves where marks are so dense that they would fill the memory."""
    mark = mavlink.marks(buffer)
    if len(buffer) < 4 * MARGIN or np.count_nonzero(mark) <= MARKS:
        return _sound(buffer, mark, stamp)
    middle = len(buffer) // 2
    left = sound_frames(buffer[: middle + MARGIN], stamp)
    left = left[left.at < middle]
    first = max(middle, int(left.end[-1]) if len(left) else 0)
    right = sound_frames(buffer[middle - MARGIN :], stamp).moved(middle - MARGIN)
    return mavlink.merged(left, right[right.at >= first])


def _sound(buffer: Bytes, mark: Mask, stamp: int) -> Frames:
    """Find the frames with a right checksum that do not overlap."""
    at = np.flatnonzero(mark[: max(0, len(buffer) - 7)])
    end = mavlink.ends(buffer, at)
    inside = (end > 0) & (end <= len(buffer))
    at, end = at[inside], end[inside]
    # what leads behind the buffer is not known to break the chain
    following = end + stamp
    linked = mark[np.minimum(following, len(mark) - 1)] | (following >= len(mark))
    frames = _disjoint(_checked(buffer, at[linked], end[linked]), stamp)
    start, stop, broken = _gap_edges(buffer, frames, stamp)
    if not broken.any():
        return frames
    broken[broken] = ~_bridged(buffer, start[broken], stop[broken], stamp)[0]
    if not broken.any():
        return frames
    loose = np.flatnonzero(~linked)
    before = np.searchsorted(frames.at, at[loose], side="right")
    within = broken[before] & (at[loose] >= start[before]) & (end[loose] <= stop[before] + stamp)
    tried = loose[within]
    more = _checked(buffer, at[tried], end[tried])
    return _disjoint(mavlink.merged(frames, more), stamp) if len(more) else frames


def _disjoint(frames: Frames, stamp: int) -> Frames:
    """Drop frames that begin inside another one; a frame in the chain goes before one that is not.

    A wrong frame passes the checksum once in 65,536, so few are looked at one by one.
    """
    if not np.any(frames.at[1:] < frames.end[:-1]):
        return frames
    furthest = np.maximum.accumulate(frames.end)
    doubtful = np.flatnonzero(frames.at[1:] < furthest[:-1]) + 1
    links = np.isin(frames.at - stamp, frames.end).astype(np.int64)
    links += np.isin(frames.end + stamp, frames.at)
    kept = np.ones(len(frames), np.bool_)
    for i in doubtful:
        j = i - 1
        while j >= 0 and not kept[j]:
            j -= 1
        if j >= 0 and frames.at[i] < frames.end[j]:
            kept[j if links[i] > links[j] else i] = False
    return frames[kept]


def _gap_edges(buffer: Bytes, frames: Frames, stamp: int) -> tuple[Ints, Ints, Mask]:
    """Where each gap begins and ends, before each frame and behind the last, and if it is one."""
    start = np.concatenate([[0], frames.end])
    stop = np.concatenate([frames.at - stamp, [len(buffer)]])
    return start, stop, start != stop


def gaps_between(buffer: Bytes, frames: Frames, stamp: int) -> tuple[Ints, Ints, Ints, Ints]:
    """Bytes, bad frames, unknown frames and their bytes in each gap."""
    start, stop, broken = _gap_edges(buffer, frames, stamp)
    bad, unknown, unknown_bytes = (np.zeros(len(start), np.int64) for _ in range(3))
    if broken.any():
        bridged, *counts = _bridged(buffer, start[broken], stop[broken], stamp)
        bad[broken] = np.where(bridged, counts[0], 1)
        unknown[broken] = np.where(bridged, counts[1], 0)
        unknown_bytes[broken] = np.where(bridged, counts[2], 0)
    return stop - start, bad, unknown, unknown_bytes


def _bridged(buffer: Bytes, start: Ints, stop: Ints, stamp: int) -> tuple[Mask, Ints, Ints, Ints]:
    """Walk from header to header through each gap.

    Returns
    -------
    Whether the walk comes out at the gap's end, and how many frames it met of known messages
    (their checksums are wrong), of unknown messages, and the bytes of these.
    """
    place = start.copy()
    bad, unknown, unknown_bytes = (np.zeros(len(start), np.int64) for _ in range(3))
    walking = np.flatnonzero(start < stop)
    for _ in range(BRIDGE):
        at = place[walking] + stamp
        there = at + 12 <= len(buffer)
        walking, at = walking[there], at[there]
        end = np.where(buffer[at] - np.uint8(mavlink.V2) < 2, mavlink.ends(buffer, at), -1)
        fits = (end > 0) & (end <= stop[walking])
        walking, at, end = walking[fits], at[fits], end[fits]
        foreign = ~mavlink.known(mavlink.headers(buffer, at, end).number)
        bad[walking] += ~foreign
        unknown[walking] += foreign
        unknown_bytes[walking] += np.where(foreign, end - at + stamp, 0)
        place[walking] = end
        walking = walking[end < stop[walking]]
        if not len(walking):
            break
    return place == stop, bad, unknown, unknown_bytes
