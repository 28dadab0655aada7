"""The low-pass filter of sensors: its step and its frequency response."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from rpbi.sensors.filters import LowPass

DT_S = 0.001


def response(cutoff_hz, inputs):
    low_pass = LowPass(cutoff_hz, DT_S)
    outputs = []
    for value in inputs:
        low_pass.step(np.array([value]))
        outputs.append(low_pass.output[0])
    return np.array(outputs)


@pytest.mark.parametrize("cutoff_hz", [1.0, 10.0, 300.0, 5000.0])
def test_step_response_is_exact_at_every_tick(cutoff_hz):
    found = response(cutoff_hz, [0.0] + [1.0] * 100)
    assert found[1:] == pytest.approx([1 - math.exp(-2 * math.pi * cutoff_hz * DT_S * n) for n in range(1, 101)])


def test_starts_at_its_first_input_without_a_transient():
    assert np.array_equal(response(5.0, [7.0] * 20), np.full(20, 7.0))


@pytest.mark.parametrize("cutoff_hz", [2.0, 10.0, 20.0])
def test_half_the_power_passes_at_the_cutoff(cutoff_hz):
    ticks = round(20 / cutoff_hz / DT_S)
    wave = np.exp(2j * math.pi * cutoff_hz * DT_S * np.arange(ticks))
    settled = slice(ticks // 2, None)
    found = (response(cutoff_hz, wave.real) + 1j * response(cutoff_hz, wave.imag))[settled] / wave[settled]
    gain = abs(found.mean())
    assert 20 * math.log10(gain) == pytest.approx(20 * math.log10(1 / math.sqrt(2)), abs=0.1)
    assert math.degrees(cmath.phase(found.mean())) == pytest.approx(-45.0, abs=4.0)
