"""Presses and releases of keys: none lost, none told twice, whatever PyBullet tells them in."""

from __future__ import annotations

import pytest

from rpbi.window import DOWN, PRESSED, RELEASED, ButtonHistory


@pytest.mark.parametrize(
    ("states", "happened"),
    [
        ([3, 1, 1, 4], [PRESSED, DOWN, DOWN, RELEASED]),
        ([6], [PRESSED, RELEASED]),  # a tap between two looks
        ([4], [PRESSED, RELEASED]),  # a tap within one frame of the window
        ([6, 6], [PRESSED, RELEASED, PRESSED, RELEASED]),
        ([3, 7, 4], [PRESSED, RELEASED, PRESSED, RELEASED]),  # let go and pressed again
        ([3, 3, 4], [PRESSED, RELEASED, PRESSED, RELEASED]),  # the same within one frame of the window
        ([7, 4], [PRESSED, RELEASED, PRESSED, RELEASED]),
        ([3, 6], [PRESSED, RELEASED, PRESSED, RELEASED]),
        ([1, 4], [DOWN, RELEASED]),  # pressed before the window looked
    ],
)
def test_each_press_and_release_is_reported(states: list[int], happened: list[int]) -> None:
    history = ButtonHistory()
    assert [each for state in states for each in history.observe(97, state)] == happened


def test_buttons_do_not_mix() -> None:
    history = ButtonHistory()
    assert history.observe(97, 3) == [PRESSED]
    assert history.observe(98, 3) == [PRESSED]
    assert history.observe(97, 4) == [RELEASED]
    assert history.observe(98, 1) == [DOWN]
