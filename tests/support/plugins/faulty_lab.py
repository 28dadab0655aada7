"""Classes of another package that do everything wrong, for tests."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from custom_ros_tools.errors import ConfigError, Problem
from rpbi.bodies import Body, BodyConfig
from rpbi.bodies.dynamic import DynamicObject
from rpbi.engine.inputs import Input
from rpbi.sensors import BodySensor


class Runaway(DynamicObject):
    """An object that is soon beyond all numbers."""

    def before_step(self, tick: int) -> None:
        super().before_step(tick)
        self.pb.resetBaseVelocity(self.body_id, (1e200, 0.0, 0.0))


class ThingConfig(BodyConfig):
    """YAML of a thing: where it fails, and an input that it takes, with its topic."""

    fails: str = ""
    takes: str = ""
    topic: str = ""


class Thing(Body):
    """A ball that fails where it is told to."""

    Config = ThingConfig

    def __init__(self, pb: Any, config: ThingConfig) -> None:
        shape = pb.createCollisionShape(pb.GEOM_SPHERE, radius=0.1)
        super().__init__(pb, config.name, pb.createMultiBody(1.0, shape))
        self.fails, self.takes, self.topic = config.fails, config.takes, config.topic
        if self.fails == "init":
            raise KeyError("no such key")

    def before_step(self, tick: int) -> None:
        if self.fails == "before_step" and tick == 5:
            raise ZeroDivisionError("division by zero")
        if self.fails == "pybullet":
            self.pb.getBasePositionAndOrientation(99)

    def motion_state(self) -> tuple[float, ...]:
        if self.fails == "motion_state":
            raise LookupError("lost")
        return super().motion_state()

    def sensors(self) -> tuple[Any, ...]:
        if self.fails == "sensors":
            raise RuntimeError("no sensors today")
        return ()

    def inputs(self) -> dict[str, Input]:
        return {self.takes: Input(self._check, self._push, ros_topic=self.topic)} if self.takes else {}

    def _check(self, value: float) -> float:
        if self.fails == "check":
            raise KeyError("no such unit")
        return value

    def _push(self, value: float) -> None:
        raise RuntimeError(f"no pushing by {value}")


class Balloon(DynamicObject):
    """Flies away; nothing is wrong with it."""

    def before_step(self, tick: int) -> None:
        self.pb.applyExternalForce(self.body_id, -1, (0.0, 0.0, 20.0), (0.0, 0.0, 0.0), self.pb.LINK_FRAME)


class Number(NamedTuple):
    """A sample."""

    name: str
    values: tuple[float, ...]


class Gauge(BodySensor):
    """Reads a number."""

    sample_type = Number
    values: Any = (1.0, 2.0)

    def read(self, tick: int) -> Any:
        return Number(self.name, self.values)


class NanGauge(Gauge):
    """Reads what is none."""

    values = (1.0, math.nan)


class MisnamedGauge(Gauge):
    """Gives its samples another name."""

    def read(self, tick: int) -> Any:
        return Number("gauge", (1.0,))


class WatchingGauge(Gauge):
    """Counts ticks after their physics; nothing is wrong with it."""

    values = (0.0,)

    def after_step(self, tick: int) -> None:
        self.values = (self.values[0] + 1.0,)


class OddGauge(Gauge):
    """Returns no sample."""

    def read(self, tick: int) -> Any:
        return 3.0


class BrokenGauge(Gauge):
    """Cannot read."""

    def read(self, tick: int) -> Any:
        return [][0]


class UnmadeGauge(Gauge):
    """Cannot be made."""

    def __init__(self, body: Body, config: Any) -> None:
        raise OSError("no such device")


class RefusingGauge(Gauge):
    """Refuses its body in its own words."""

    def __init__(self, body: Body, config: Any) -> None:
        raise ConfigError([Problem(body.name, "sensors", "needs a body with joints")])


class LostGauge(Gauge):
    """Names a topic that is not there."""

    ros_topic = "faulty_lab:LOST_TOPIC"


class OddTopicGauge(Gauge):
    """Names something else as its topic."""

    ros_topic = "faulty_lab:NOT_A_CLASS"


class NoConfig(Gauge):
    """Has a Config of another kind."""

    Config = int  # type: ignore[assignment]


NOT_A_CLASS = 3
