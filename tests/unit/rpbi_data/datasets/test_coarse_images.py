"""Faults of videos that coarse images show: colours, frozen frames, order, other cameras."""

from __future__ import annotations

import numpy as np
import pytest

from rpbi_data.datasets.coarse_images import coarse, frozen_faults, image_faults

COUNT = 60
FROZEN = slice(20, 40)


def film(much: float = 2.0, seed: int = 0) -> np.ndarray:
    """Images of a dim scene in which something small moves, shape (n, 8, 8, 3)."""
    chance = np.random.default_rng(seed)
    scene = np.array([108.0, 100.0, 120.0]) + chance.normal(0.0, 2.0, (8, 8, 3))
    images = np.repeat(scene[None], COUNT, axis=0)
    for number in range(COUNT):
        images[number, 3:5, :, :] += 4.0 * much * np.sin(0.15 * number + np.arange(8))[None, :, None]
    return images


def decoded(images: np.ndarray, noise: float = 0.3) -> np.ndarray:
    """Images as a codec returns them."""
    return images + np.random.default_rng(9).normal(0.0, noise, images.shape)


@pytest.mark.parametrize(
    ("order", "words"),
    [((2, 1, 0), "blue, green, red"), ((1, 0, 2), "green, red, blue"), ((1, 2, 0), "green, blue, red")],
)
def test_swapped_colours_are_named(order: tuple[int, ...], words: str) -> None:
    images = film()
    expected = [f"its red, green and blue are the {words} of the images that were exported"]
    assert list(image_faults("a", decoded(images)[..., list(order)], {"a": images.astype(np.float16)})) == expected


def test_frozen_frames_are_named() -> None:
    images = film(0.9)
    frozen = decoded(images, 0.01)
    frozen[FROZEN] = frozen[FROZEN.start]
    (fault,) = image_faults("a", frozen, {"a": images.astype(np.float16)})
    assert fault == "20 frames are frozen while the images that were exported move, first frame 20"


@pytest.mark.parametrize("much", [0.0, 0.02, 0.3, 2.0, 20.0])
@pytest.mark.parametrize("noise", [0.0, 0.3, 1.0])
def test_good_videos_have_no_fault(much: float, noise: float) -> None:
    for seed in range(5):
        images = film(much, seed)
        for scene in (images, np.repeat(images.mean(axis=3, keepdims=True), 3, axis=3), images * 0.0 + 7.0):
            stored = {"a": scene.astype(np.float16), "b": film(2.0, seed + 50).astype(np.float16)}
            assert list(image_faults("a", decoded(scene, noise), stored)) == []
            older = {"a": (scene @ np.array([0.299, 0.587, 0.114])).astype(np.float16)}  # which had brightness alone
            assert list(image_faults("a", decoded(scene, noise), older)) == []


def test_frozen_frames_of_another_tool_are_named_while_joints_move() -> None:
    images, states = film(), np.sin(0.1 * np.arange(COUNT))[:, None] + np.arange(COUNT)[:, None]
    frozen = images.copy()
    frozen[FROZEN] = frozen[FROZEN.start]
    assert list(frozen_faults(frozen, states)) == ["19 frames are frozen while the joints move, first frame 21"]
    assert list(frozen_faults(images, states)) == []
    still = states.copy()
    still[FROZEN] = still[FROZEN.start]
    assert list(frozen_faults(frozen, still)) == []  # nothing moves meanwhile
    assert list(frozen_faults(film(0.0), states)) == []  # the camera does not see the joints
    often = images.copy()
    for start in range(0, COUNT, 20):
        often[start : start + 18] = often[start]
    assert list(frozen_faults(often, states)) == []  # it sees them now and then


def test_coarse_images_are_means_of_colours() -> None:
    pixels = np.zeros((48, 64, 3), np.uint8)
    pixels[:24, :, 0], pixels[:, 32:, 2] = 100, 50
    found = coarse(pixels)
    assert found.shape == (8, 8, 3)
    assert (found[:4, :, 0] == 100).all() and (found[4:, :, 0] == 0).all() and (found[:, 4:, 2] == 50).all()
