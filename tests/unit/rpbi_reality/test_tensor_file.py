"""Files of tensors in the old format of PyTorch, and the converter of tosses."""

from __future__ import annotations

import os
import pickle
import struct
import sys
import types

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from custom_ros_tools.errors import ConfigError
from rpbi_reality.tosses.convert_tosses import UNIT_M, convert_tosses
from rpbi_reality.tosses.tensor_file import MAGIC, read_tensor
from rpbi_reality.tosses.toss_data import TossData


class _Storage:
    pass


class _Tensor:
    """Pickled as PyTorch pickles a tensor."""

    def __init__(self, shape):
        self.shape = shape

    def __reduce__(self):
        strides = tuple(int(np.prod(self.shape[i + 1 :])) for i in range(len(self.shape)))
        rebuild = sys.modules["torch._utils"]._rebuild_tensor_v2
        return rebuild, (_Storage(), 0, self.shape, strides, False, None)


class _Pickler(pickle.Pickler):
    def persistent_id(self, obj):
        return (
            ("storage", sys.modules["torch"].DoubleStorage, "0", "cpu", 1, None) if isinstance(obj, _Storage) else None
        )


@pytest.fixture
def write_tensor(monkeypatch):
    torch, utils = types.ModuleType("torch"), types.ModuleType("torch._utils")
    torch.DoubleStorage = type("DoubleStorage", (), {"__module__": "torch"})

    def _rebuild_tensor_v2(*_):
        return None

    _rebuild_tensor_v2.__module__ = "torch._utils"
    _rebuild_tensor_v2.__qualname__ = "_rebuild_tensor_v2"
    utils._rebuild_tensor_v2 = _rebuild_tensor_v2
    monkeypatch.setitem(sys.modules, "torch", torch)
    monkeypatch.setitem(sys.modules, "torch._utils", utils)

    def write(path, array, body=None):
        with path.open("wb") as file:
            for header in (MAGIC, 1001, {"little_endian": True}):
                pickle.dump(header, file, 2)
            _Pickler(file, 2).dump(_Tensor(array.shape) if body is None else body)
            pickle.dump(["0"], file, 2)
            file.write(struct.pack("<q", array.size) + array.astype("<f8").tobytes())
        return path

    return write


def test_tensor_is_read(tmp_path, write_tensor):
    array = np.arange(24.0).reshape(1, 4, 6)
    assert (read_tensor(write_tensor(tmp_path / "1.pt", array)) == array).all()


class _Hostile:
    def __reduce__(self):
        return os.system, ("touch /tmp/harmed",)


def test_code_in_a_tensor_file_is_refused(tmp_path, write_tensor):
    path = write_tensor(tmp_path / "1.pt", np.zeros(3), _Hostile())
    with pytest.raises(ConfigError, match=r"1\.pt: expected a tensor: posix.system is no part of a tensor"):
        read_tensor(path)
    assert not os.path.exists("/tmp/harmed")


def test_cut_off_tensor_is_refused(tmp_path, write_tensor):
    path = write_tensor(tmp_path / "1.pt", np.zeros((2, 3)))
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(ConfigError, match="expected 6 numbers, got 5"):
        read_tensor(path)


def test_tosses_are_converted_with_the_state_at_the_start(tmp_path, write_tensor):
    source = tmp_path / "repository/data/tosses_processed"
    source.mkdir(parents=True)
    time = np.arange(60) / 148.0
    spin, centre = np.array([1.0, -2.0, 3.0]), np.array([0.0, 0.0, 0.0057])
    rotation = Rotation.from_rotvec(np.outer(time, spin))
    height = np.maximum(0.3 - 9.605 * time**2 / 2.0, 0.05)
    mass = np.stack([0.1 + 0.8 * time, 0.2 * time, height], 1)
    position = mass - rotation.apply(centre)
    rows = np.zeros((60, 19))
    rows[:, :3], rows[:, [4, 5, 6, 3]] = position / UNIT_M, rotation.as_quat()
    write_tensor(source / "5.pt", rows[None])
    assert convert_tosses(tmp_path / "repository", tmp_path / "data/cube_tosses.npz") == 1
    toss = TossData.read(tmp_path / "data/cube_tosses.npz").tosses[0]
    assert toss.name == "5"
    assert toss.start.position == pytest.approx(position[0], abs=1e-4)
    velocity = np.array([0.8, 0.2, 0.0]) - np.cross(spin, centre)
    assert toss.start.linear_velocity == pytest.approx(velocity, abs=5e-3)
    assert toss.start.angular_velocity == pytest.approx(spin, abs=1e-2)


def test_folder_without_tosses_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"expected files N.pt in data/tosses_processed"):
        convert_tosses(tmp_path, tmp_path / "x.npz")
