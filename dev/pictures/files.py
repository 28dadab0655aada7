"""Small files for the pages: PNG with a palette, and moving GIF."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

MAX_MOVIE_BYTES = 3_000_000
"""Largest size of a moving picture, so that pages load fast."""
NEARLY_WHITE = 245
"""Colours whose red, green and blue are larger become white."""
SAMPLES = 20
"""Number of frames from which the common colours are taken."""


def common_palette(frames: Sequence[Image.Image], colours: int) -> Image.Image:
    """Returns a palette for frames, in which small coloured things have their colours, too.

    Each colour counts by the square root of its number of pixels. White stays white, as the page around the picture.
    """
    pixels = np.concatenate([np.asarray(frame.convert("RGB")).reshape(-1, 3) for frame in frames])
    rounded = (pixels.astype(np.uint16) + 2) // 5 * 5
    found, counts = np.unique(rounded.astype(np.uint8), axis=0, return_counts=True)
    weighted = np.repeat(found, np.ceil(np.sqrt(counts)).astype(int), axis=0)
    palette = Image.fromarray(weighted[None]).quantize(colours)
    entries = np.reshape(palette.getpalette(), (-1, 3))
    entries[entries.min(axis=1) > NEARLY_WHITE] = 255
    palette.putpalette(entries.ravel().tolist())
    return palette


def write_png(path: Path, picture: Image.Image, colours: int = 256, dither: bool = False) -> None:
    """Writes a picture with a palette; a photograph with gradients needs all 256 colours, and dithering."""
    palette, kind = common_palette([picture], colours), Image.Dither.FLOYDSTEINBERG if dither else Image.Dither.NONE
    picture.convert("RGB").quantize(palette=palette, dither=kind).save(path, optimize=True)


def give_palette(path: Path) -> None:
    """Writes the PNG file of a plot again with a palette, so that it is smaller."""
    with Image.open(path) as picture:
        write_png(path, picture.convert("RGB"))


def write_gif(
    path: Path,
    frames: Sequence[Image.Image],
    hz: float,
    last_s: float = 1.5,
    colours: int = 128,
    most_bytes: int = MAX_MOVIE_BYTES,
) -> None:
    """Writes frames as a moving picture that repeats for ever.

    Args:
        path: The file.
        frames: Frames of equal size.
        hz: Frames per second.
        last_s: Time for which the last frame stays [s].
        colours: Number of colours, common to all frames.
        most_bytes: Largest size of the file.

    Raises:
        ValueError: If the file is larger than `most_bytes`.
    """
    palette = common_palette(frames[:: max(1, len(frames) // SAMPLES)], colours)
    drawn = [each.convert("RGB").quantize(palette=palette, dither=Image.Dither.NONE) for each in frames]
    durations_ms = [round(1e3 / hz)] * (len(drawn) - 1) + [round(1e3 * last_s)]
    drawn[0].save(path, save_all=True, append_images=drawn[1:], duration=durations_ms, loop=0, optimize=True)
    if (size := path.stat().st_size) > most_bytes:
        raise ValueError(f"{path}: {size / 1e6:.1f} MB, limit {most_bytes / 1e6:g} MB: fewer or smaller frames")
