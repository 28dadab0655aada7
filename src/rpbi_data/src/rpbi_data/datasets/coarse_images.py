"""Coarse images, which the export stores in addition to videos, and checks of videos."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

COARSE = 8
"""Number of rows, and of columns, of a coarse image."""
_BRIGHTNESS = np.array((0.299, 0.587, 0.114))
"""Weights of red, green and blue in the brightness, as in video codecs, which preserve it better than colours."""
_STRIDE = 2
"""Spacing of the pixel rows and columns that are used for a coarse image."""

MAX_IMAGE_DIFFERENCE = 12.0
"""A frame that differs by more than this from its exported image is reported [RMS over 8 x 8 parts, of 255]."""
MIN_IMAGE_DIFFERENCE = 3.0
"""A smaller difference between a frame and its exported image is never reported [RMS over 8 x 8 parts, of 255]."""
MEDIANS = 5.0
"""A difference between both limits is reported if it exceeds this multiple of the video's median difference."""
MIN_GAIN = 0.5
"""A shift of frames, a swap of colours or a swap of cameras is reported if undoing it leaves less than this share of
the mean squared difference.
"""
MIN_MOTION = 1e-2
"""Mean squared difference below which neither a shift of frames nor a swap of cameras is reported [of 255^2]."""
MIN_COLOUR_DIFFERENCE = 4.0
"""Mean squared difference of colours below which a swap of colours is not reported [of 255^2]."""
FROZEN_FRAMES = 10
"""Number of successive frames that are frozen if they hardly change while the exported images change."""
MIN_FROZEN_MOTION = 1.0
"""Change of the exported images within `FROZEN_FRAMES` frames that counts as motion [RMS over the parts, of 255]."""
MAX_FROZEN_SHARE = 0.1
"""Frames are frozen if they change by less than this share of the change of the exported images."""
STILL_FRAMES = 15
"""For data sets of other tools: number of successive frames that are frozen if they do not change while joints move."""
MAX_STILL_CHANGE = 0.02
"""Largest change from one frozen frame to the next, in data sets of other tools [RMS, of 255]."""
MIN_SEEN_FRAMES = 30
"""Frozen frames are reported only if at least this number of other frames was taken while joints moved."""
MIN_SEEN_SHARE = 0.98
"""Frozen frames are reported only if at least this share of the other frames changes while joints move."""


def coarse(pixels: Array) -> Array:
    """Divides an image into 8 x 8 parts, and returns the mean colour of each part.

    Args:
        pixels: Pixels of the image, shape (height, width, 3), uint8.

    Returns:
        Red, green and blue of each part, from 0 to 255, shape (8, 8, 3), float32.
    """
    part = pixels[::_STRIDE, ::_STRIDE]
    rows = np.linspace(0, part.shape[0], COARSE + 1).astype(int)[:-1]
    columns = np.linspace(0, part.shape[1], COARSE + 1).astype(int)[:-1]
    counts = np.outer(np.diff([*rows, part.shape[0]]), np.diff([*columns, part.shape[1]]))
    by_row = np.add.reduceat(part, rows, axis=0, dtype=np.uint32)
    sums = np.add.reduceat(by_row, columns, axis=1)
    return (sums / counts[..., None]).astype(np.float32)


def image_faults(key: str, found: Array, stored: Mapping[str, Array]) -> Iterator[str]:
    """Yields a message if the frames of a video differ from the exported images.

    Args:
        key: Key of the camera.
        found: Coarse images of the video's n frames, shape (n, 8, 8, 3).
        stored: Coarse images that the export stored, indexed by camera, shape (n, 8, 8, 3). Older exports contain only
            the brightness, shape (n, 8, 8).
    """
    colours = found.astype(float)
    known = {
        camera: each.astype(float) for camera, each in stored.items() if each.shape in (found.shape, found.shape[:3])
    }
    if key not in known:
        return
    exported, bright = known[key], colours @ _BRIGHTNESS
    images = {camera: _brightness(each) for camera, each in known.items()}
    own = images.pop(key)
    rest = _mean_square(bright - own)
    for other, each in images.items():
        if rest > MIN_MOTION and _mean_square(bright - each) < MIN_GAIN * rest:
            yield f"its frames are the images of '{other}'"
            return
    if exported.ndim == 4 and (order := _order_of_colours(colours, exported)):
        yield f"its red, green and blue are the {', '.join(order)} of the images that were exported"
        return
    if len(found) > 2:
        at, right = bright - bright.mean(axis=0), own - own.mean(axis=0)
        rest = _mean_square(at[1:-1] - right[1:-1])
        for words, shifted in (("late", right[:-2]), ("early", right[2:])):
            if rest > MIN_MOTION and _mean_square(at[1:-1] - shifted) < MIN_GAIN * rest:
                yield f"its frames are {words} by one frame"
                return
    frozen = _frozen(bright, own)
    if len(frozen):
        yield f"{len(frozen)} frames are frozen while the images that were exported move, first frame {frozen[0]}"
        return
    differences = np.sqrt(((bright - own) ** 2).mean(axis=(1, 2)))
    limit = min(max(MIN_IMAGE_DIFFERENCE, MEDIANS * float(np.median(differences))), MAX_IMAGE_DIFFERENCE)
    wrong = np.flatnonzero(differences > limit)
    if len(wrong):
        yield f"{len(wrong)} frames show another image than was exported, first frame {wrong[0]}"


def frozen_faults(images: Array, states: Array) -> Iterator[str]:
    """Yields a message if frames of a camera do not change while the joints move.

    This check is for data sets of other tools, which lack stored coarse images. The camera may not always see the
    moving joints. So frozen frames are reported only if nearly all other frames change while the joints move.

    Args:
        images: Coarse images of the frames, shape (n, 8, 8, 3).
        states: Joint positions, shape (n, columns) [rad or m].
    """
    if len(images) != len(states) or len(images) < 2:
        return
    changes = np.sqrt((np.diff(images.astype(float), axis=0) ** 2).mean(axis=(1, 2, 3)))
    steps = np.linalg.norm(np.diff(states.astype(float), axis=0), axis=1)
    is_still, is_moving = changes < MAX_STILL_CHANGE, steps > 0.2 * np.quantile(steps, 0.9)
    frozen = _long_runs(is_still & is_moving, STILL_FRAMES)
    others = is_moving & ~frozen
    if frozen.any() and others.sum() >= MIN_SEEN_FRAMES and (~is_still[others]).mean() >= MIN_SEEN_SHARE:
        yield f"{frozen.sum()} frames are frozen while the joints move, first frame {np.argmax(frozen) + 1}"


def _brightness(images: Array) -> Array:
    return images @ _BRIGHTNESS if images.ndim == 4 else images


def _order_of_colours(found: Array, exported: Array) -> list[str]:
    """Returns the names of the exported colours that appear as red, green and blue in the frames.

    For instance, `["blue", "green", "red"]` means that red and blue are swapped. Empty if colours are not swapped.
    """
    rest = _mean_square(found - exported)
    if rest < MIN_COLOUR_DIFFERENCE:
        return []
    rests = {order: _mean_square(found - exported[..., order]) for order in permutations(range(3))}
    best = min(rests, key=rests.__getitem__)
    return [("red", "green", "blue")[channel] for channel in best] if rests[best] < MIN_GAIN * rest else []


def _frozen(found: Array, own: Array) -> Array:
    """Returns the indices of the frames that hardly change while the exported images change.

    Args:
        found: Brightness of the frames, shape (n, 8, 8).
        own: Brightness of the exported images, shape (n, 8, 8).
    """
    count = len(found) - FROZEN_FRAMES + 1
    if count < 1:
        return np.empty(0, int)
    moved = np.zeros((2, count))
    for number, images in enumerate((found, own)):
        for later in range(1, FROZEN_FRAMES):
            away = images[later : later + count] - images[:count]
            moved[number] = np.maximum(moved[number], np.sqrt((away**2).mean(axis=(1, 2))))
    starts = np.flatnonzero((moved[1] > MIN_FROZEN_MOTION) & (moved[0] < MAX_FROZEN_SHARE * moved[1]))
    return np.unique(starts[:, None] + np.arange(FROZEN_FRAMES))


def _long_runs(is_so: Array, least: int) -> Array:
    """Returns a mask that is true where `is_so` has at least `least` successive true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_so, [False]]).astype(int)))
    found = np.zeros(len(is_so), bool)
    for start, stop in edges.reshape(-1, 2):
        found[start:stop] = stop - start >= least
    return found


def _mean_square(values: Array) -> float:
    return float((values**2).mean())
