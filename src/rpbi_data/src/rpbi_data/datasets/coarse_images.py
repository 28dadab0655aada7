"""Coarse images, stored with videos, and the faults of videos that they reveal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

COARSE = 8
"""Rows and columns of a coarse image."""
_BRIGHTNESS = np.array((0.299, 0.587, 0.114))
"""Shares of red, green and blue, as codecs have them; compression keeps brightness better than colours."""
_STRIDE = 2
"""Distance of the rows and columns of pixels that count for a coarse image."""

MAX_IMAGE_DIFFERENCE = 12.0
"""Largest difference between a frame and its image, of 255, as the root mean square over the parts."""
MIN_IMAGE_DIFFERENCE = 3.0
"""Least such difference that is reported; in between, one that is a multiple of the median of the video is."""
MEDIANS = 5.0
"""That multiple."""
MIN_GAIN = 0.5
"""Another order of frames or colours, or another camera, is reported if it leaves less than this share of squared
differences.
"""
MIN_MOTION = 1e-2
"""Mean squared difference, of 255 squared, below which neither another order nor another camera is reported."""
MIN_COLOUR_DIFFERENCE = 4.0
"""Mean squared difference of colours, of 255 squared, below which another order of colours is not reported."""
FROZEN_FRAMES = 10
"""Frames that are frozen if they do not change while the images that were exported do."""
MIN_FROZEN_MOTION = 1.0
"""Least change of the exported images over so many frames, of 255, as the root mean square over the parts."""
MAX_FROZEN_SHARE = 0.1
"""Largest share of that change that frozen frames have."""
STILL_FRAMES = 15
"""Frames that are frozen, in a data set of another tool, if they do not change while the joints move."""
MAX_STILL_CHANGE = 0.02
"""Largest change from one such frame to the next, of 255."""
MIN_SEEN_FRAMES = 30
"""Other frames in which the joints move, nearly all of which have to change: the camera sees the joints."""
MIN_SEEN_SHARE = 0.98
"""Their share that has to change."""


def coarse(pixels: Array) -> Array:
    """Returns the mean colours of 8 by 8 parts of an image.

    Args:
        pixels: Shape (height, width, 3), uint8.

    Returns:
        Shape (8, 8, 3), float32.
    """
    part = pixels[::_STRIDE, ::_STRIDE]
    rows = np.linspace(0, part.shape[0], COARSE + 1).astype(int)[:-1]
    columns = np.linspace(0, part.shape[1], COARSE + 1).astype(int)[:-1]
    counts = np.outer(np.diff([*rows, part.shape[0]]), np.diff([*columns, part.shape[1]]))
    by_row = np.add.reduceat(part, rows, axis=0, dtype=np.uint32)
    sums = np.add.reduceat(by_row, columns, axis=1)
    return (sums / counts[..., None]).astype(np.float32)


def image_faults(key: str, found: Array, stored: Mapping[str, Array]) -> Iterator[str]:
    """Yields a sentence if the frames of a video differ from the exported images.

    Args:
        key: The camera.
        found: Coarse images of the frames, shape (n, 8, 8, 3).
        stored: Coarse images of the images of all cameras, of the same shape; those of older exports have brightness
            alone, shape (n, 8, 8).
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
    """Yields a sentence if frames of a camera that sees the joints do not change while these move.

    It is for data sets of other tools, whose images are not known. A camera that the joints leave now and then is no
    reason: nearly all other frames in which they move have to change.

    Args:
        images: Coarse images of the frames, shape (n, 8, 8, 3).
        states: Positions of the joints, shape (n, columns).
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
    """Returns the exported colours that appear as red, green and blue in the frames; none if they are unchanged."""
    rest = _mean_square(found - exported)
    if rest < MIN_COLOUR_DIFFERENCE:
        return []
    rests = {order: _mean_square(found - exported[..., order]) for order in permutations(range(3))}
    best = min(rests, key=rests.__getitem__)
    return [("red", "green", "blue")[channel] for channel in best] if rests[best] < MIN_GAIN * rest else []


def _frozen(found: Array, own: Array) -> Array:
    """Returns the numbers of the frames that do not change although their images do."""
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
    """Returns the runs of at least a number of consecutive true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_so, [False]]).astype(int)))
    found = np.zeros(len(is_so), bool)
    for start, stop in edges.reshape(-1, 2):
        found[start:stop] = stop - start >= least
    return found


def _mean_square(values: Array) -> float:
    return float((values**2).mean())
