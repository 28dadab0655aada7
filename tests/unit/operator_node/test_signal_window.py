"""The last seconds of a signal, as records of a message and as arrays."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from operator_node.parser import SignalWindow, reconstruct_interface_log_msg


def arrays(window: SignalWindow, size: int) -> tuple[np.ndarray, np.ndarray]:
    return reconstruct_interface_log_msg(SimpleNamespace(data=window.data()), size)


@pytest.mark.parametrize("hz", [10, 100])
def test_window_holds_its_whole_duration_at_any_rate(hz):
    """Defect 41: 2 s held one sample."""
    window = SignalWindow(2.0)
    for step in range(5 * hz + 1):
        window.add(step / hz, (step, -step))
    times_s, signals = arrays(window, 2)
    assert times_s.shape == (2 * hz + 1,) and signals.shape == (2, 2 * hz + 1)
    assert (times_s[0], times_s[-1]) == (3.0, 5.0) and (np.diff(times_s) > 0.0).all()
    assert (signals[0] == np.arange(3 * hz, 5 * hz + 1)).all() and (signals[1] == -signals[0]).all()


def test_irregular_times_count_as_they_are():
    window = SignalWindow(1.0)
    for time_s in (0.0, 0.1, 0.9, 1.05, 1.2):
        window.add(time_s, (time_s,))
    assert arrays(window, 1)[0].tolist() == [0.9, 1.05, 1.2]
    window.forget(2.1)
    assert window.data() == [1.2, 1.2]
    window.forget(9.0)
    assert window.data() == [] and window.size == 0


def test_earlier_time_or_another_size_begins_a_new_window():
    window = SignalWindow(10.0)
    window.add(5.0, (1.0,))
    window.add(0.5, (2.0,))
    assert window.data() == [0.5, 2.0]
    window.add(0.6, (3.0, 4.0))
    assert window.data() == [0.6, 3.0, 4.0] and window.size == 2


def test_window_stays_bounded_when_time_stands_still():
    window = SignalWindow(1.0, most=10)
    for number in range(25):
        window.add(1.0, (number,))
    assert arrays(window, 1)[1].tolist() == [list(range(15, 25))]


@pytest.mark.parametrize("signal", [(), (math.nan,), (0.0, math.inf)])
def test_invalid_signal_is_refused_without_loss_of_data(signal):
    window = SignalWindow(1.0)
    window.add(0.0, (7.0,))
    with pytest.raises(ValueError, match="expected finite numbers"):
        window.add(0.1, signal)
    assert window.data() == [0.0, 7.0]


@pytest.mark.parametrize(("count", "size"), [(5, 1), (4, 2), (4, 0)])
def test_message_that_is_not_made_of_such_records_is_refused(count, size):
    with pytest.raises(ValueError, match=f"expected records of a time and {size} numbers, got {count}"):
        reconstruct_interface_log_msg(SimpleNamespace(data=[0.0] * count), size)
