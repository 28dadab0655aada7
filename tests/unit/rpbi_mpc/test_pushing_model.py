"""The quasi-static model of pushing: facts about limit surfaces and motion cones, and derivatives by differences."""

from __future__ import annotations

import casadi
import numpy as np
import pytest

from custom_ros_tools.errors import ConfigError
from rpbi_mpc.pushing.planar.model import (
    SliderConfig,
    advanced,
    complementarity,
    load_for,
    load_of,
    pusher_velocity,
    rates,
    response,
    twist_of,
)
from rpbi_mpc.pushing.planar.motion import PlanarScene, gap_and_contact, moved
from rpbi_mpc.pushing.planar.paths import PathConfig, PushPath

SLIDER = SliderConfig(length=0.1, width=0.08, friction=0.3, support="uniform")


def test_characteristic_length_is_right_for_known_shapes():
    assert SliderConfig(length=0.06, width=0.08, support="corners").characteristic_length == pytest.approx(0.05)
    square = SliderConfig(length=1.0, width=1.0, support="uniform")
    assert square.characteristic_length == pytest.approx((np.sqrt(2) + np.log(1 + np.sqrt(2))) / 6, rel=1e-3)


def test_twist_is_normal_to_the_limit_surface_and_friction_dissipates():
    random, square = np.random.default_rng(0), SLIDER.characteristic_length**2

    def height(load):
        return load[0] ** 2 + load[1] ** 2 + load[2] ** 2 / square

    for load in random.normal(size=(20, 3)) * (1.0, 1.0, 0.05):
        gradient = [(height(load + 1e-6 * axis) - height(load - 1e-6 * axis)) / 4e-6 for axis in np.eye(3)]
        twist = twist_of(load, SLIDER)
        assert np.allclose(twist, gradient, rtol=1e-5)
        assert np.dot(load, twist) > 0.0
        assert np.allclose(load_for(twist, SLIDER), load)


def test_push_through_the_centre_does_not_turn_the_slider():
    assert twist_of(load_of(0.0, 0.1, 0.0, SLIDER), SLIDER) == (0.1, 0.0, 0.0)
    assert twist_of(load_of(0.03, 0.1, 0.0, SLIDER), SLIDER)[2] < 0.0
    assert twist_of(load_of(-0.03, 0.1, 0.0, SLIDER), SLIDER)[2] > 0.0


def test_symbolic_model_equals_the_numeric_one_with_its_jacobian():
    state, control = casadi.SX.sym("x", 4), casadi.SX.sym("u", 4)
    after = casadi.vertcat(*advanced(state, control, 0.08, SLIDER))
    function = casadi.Function("f", [state, control], [after, casadi.jacobian(after, state)])
    x, u = np.array([0.1, -0.2, 0.7, 0.01]), np.array([0.05, 0.01, 0.02, 0.0])
    value, jacobian = (np.asarray(each) for each in function(x, u))
    assert np.allclose(value.ravel(), advanced(x, u, 0.08, SLIDER))
    columns = [
        (np.array(advanced(x + d, u, 0.08, SLIDER)) - advanced(x - d, u, 0.08, SLIDER)) / 2e-6 for d in 1e-6 * np.eye(4)
    ]
    assert np.allclose(jacobian, np.transpose(columns), atol=1e-6)


@pytest.mark.parametrize("control", [(0.05, 0.0, 0.0, 0.0), (0.05, 0.015, 0.03, 0.0), (0.05, -0.015, 0.0, 0.03)])
def test_pusher_velocity_and_response_are_inverse(control):
    """Sticking, and sliding to both sides; velocity and response are each other's inverse."""
    state = (0.0, 0.0, 0.0, 0.012)
    assert complementarity(control, SLIDER) == pytest.approx(0.0)
    twist, force, sliding = response(state, pusher_velocity(state, control, SLIDER), SLIDER)
    assert np.allclose(force, control[:2])
    assert sliding == pytest.approx(control[2] - control[3])
    assert np.allclose(twist, rates(state, control, SLIDER)[:3])


def test_contact_beyond_the_motion_cone_slides_at_the_friction_limit():
    _, (normal, tangential), sliding = response((0, 0, 0, 0.0), (0.02, 0.1), SLIDER)
    assert tangential == pytest.approx(SLIDER.friction * normal) and sliding > 0.0
    twist, force, sliding = response((0, 0, 0, 0.0), (-0.02, 0.1), SLIDER)
    assert twist == (0.0, 0.0, 0.0) and force == (0.0, 0.0) and sliding == 0.1


def test_complementarity_is_positive_inside_the_cone_when_the_contact_slides():
    assert complementarity((0.05, 0.0, 0.02, 0.0), SLIDER) > 0.0


def test_pusher_pushes_after_it_has_closed_the_gap():
    scene = PlanarScene(np.zeros(3), np.array([-0.05 - 0.01 - 0.01, 0.0]))
    assert gap_and_contact(scene, SLIDER, 0.01) == pytest.approx((0.01, 0.0))
    assert np.allclose(moved(scene, np.array([0.1, 0.0]), 0.09, SLIDER, 0.01).slider, 0.0)
    pushed = moved(scene, np.array([0.1, 0.0]), 0.2, SLIDER, 0.01, steps=20)
    assert np.allclose(pushed.slider, (0.01, 0.0, 0.0), atol=1e-9)


@pytest.mark.parametrize(("shape", "length"), [("line", 0.4), ("arc", 0.4), ("s", 0.8), ("eight", 2.09764)])
def test_paths_have_their_length_and_are_followed_at_their_speed(shape, length):
    path = PushPath(PathConfig(shape=shape, size=0.4, angle=1.0, start=(1.0, 2.0, 0.5), speed=0.05))
    assert path.length == pytest.approx(length, rel=1e-3)
    poses = path.poses(np.arange(0.0, path.duration_s, 0.1))
    assert poses[0] == pytest.approx([1.0, 2.0, 0.5], abs=2e-3)
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T) == pytest.approx(0.005, rel=1e-2)
    assert path.distance(poses[7, :2]) < 3e-4
    assert np.abs(np.diff(poses[:, 2])).max() < 0.1


def test_wrong_paths_and_sliders_are_refused_with_their_key():
    with pytest.raises(ValueError, match="points: expected at least two different ones"):
        PushPath(PathConfig(shape="points"))
    with pytest.raises(ConfigError, match=r"slider.yaml: length: must be > 0 \[m\], got -1"):
        SliderConfig.parse({"length": -1.0}, "slider.yaml")
