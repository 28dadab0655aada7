"""Toggle services, and proxies that wait for services."""

from __future__ import annotations

import threading

import pytest
import rospy
from node_world import Rosout
from std_srvs.srv import SetBool, Trigger, TriggerResponse

from custom_ros_tools.ros import services as service_proxies
from custom_ros_tools.ros_comm import ToggleService, get_srv_handler, get_srv_handlers


@pytest.mark.quick
def test_toggle_service_calls_its_handler_and_returns_the_answer(ros):
    service = ToggleService("/lamp", lambda: (True, "shines"), lambda: (False, "was dark"))
    for to, expected in ((True, (True, "shines")), (False, (False, "was dark"))):
        answer = ros.call("/lamp", SetBool, to)
        assert (answer.success, answer.message) == expected
    service.shutdown()


def test_handler_waits_for_its_service_and_reports_it(ros, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(service_proxies, "PATIENCE_S", 0.1)
    rosout = Rosout(ros, own=True)
    got: list[rospy.ServiceProxy] = []
    waiting = threading.Thread(target=lambda: got.append(get_srv_handler("late", Trigger)), daemon=True)
    waiting.start()
    rosout.wait_for(["still waiting for service /late"])
    assert not got
    service = rospy.Service("/late", Trigger, lambda _: TriggerResponse(True, "at last"))
    waiting.join(60.0)
    assert got[0]().message == "at last"
    service.shutdown()


@pytest.mark.parametrize("persistent", [False, True])
def test_several_handlers_come_by_name(ros, persistent):
    services = [
        rospy.Service(f"/{name}", Trigger, lambda _, name=name: TriggerResponse(True, name)) for name in ("one", "two")
    ]
    handlers = get_srv_handlers({"one": Trigger, "/two": Trigger}, persistent)
    assert [handlers[name]().message for name in ("one", "/two")] == ["one", "two"]
    assert [handlers[name]().message for name in ("one", "/two")] == ["one", "two"], "again"
    for handler in handlers.values():
        handler.close()
    for service in services:
        service.shutdown()
