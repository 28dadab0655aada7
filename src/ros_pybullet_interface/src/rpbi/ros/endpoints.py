"""Types that describe topics and services, and functions that open them.

The node opens topics and services from these descriptions, and the reference pages list them.
"""

import inspect
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import rospy

from custom_ros_tools.errors import ConfigError, InterfaceError, Problem, bounded
from custom_ros_tools.plugins import find, full_name
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from custom_ros_tools.ros.rospy_internals import close_poller_with
from rpbi.bodies import Body
from rpbi.samples import LinkPoseSample

Owners = Callable[[Body], Sequence[str]]
"""Function that returns the owners of a topic or service within a body: the texts that replace `{name}` in its name.

An empty sequence means that the body does not have the topic or service."""


class Answer(NamedTuple):
    """Result of most service handlers: `success` and `message`, which `serve` copies into the response."""

    success: bool
    message: str


def of(body_type: type[Body]) -> Owners:
    """Returns a function that maps a body of class `body_type` to a tuple with the body's name.

    The function maps any other body to an empty tuple.
    """
    return lambda body: (body.name,) if isinstance(body, body_type) else ()


class Topic(NamedTuple):
    """A topic.

    Attributes:
        name: Name of the topic, with `{name}` in place of the name of the body, sensor or camera.
        message_type: ROS type of the messages.
        handler: For a sensor's topic, the function that converts a sample and its stamp [ns] to a message. For an
            input's topic, the function that converts a message to the input's value. For a topic in `BODY_TOPICS`, the
            function that acts on a body; its arguments are the body's context and a message. None if other code handles
            the topic.
        meaning: Content of the topic or effect of a message, in a sentence, with the YAML key that sets the rate.
        key: Key in the main YAML file; the key opens the topic, or sets the topic's rate, where 0 is off. Empty if the
            topic is always open.
        owners: Function from a body to the texts that replace `{name}`, one for each topic that the body subscribes to.
        on_tf: For a sensor's topic whose samples also go to TF: converts a sample and its stamp [ns] to poses and
            their stamp [ns]. None for other topics.
    """

    name: str
    message_type: type
    handler: Callable[..., Any] | None = None
    meaning: str = ""
    key: str = ""
    owners: Owners = of(Body)
    on_tf: Callable[[Any, int], tuple[LinkPoseSample, int]] | None = None


class Service(NamedTuple):
    """A service of the node or of bodies.

    Attributes:
        name: Name of the service, with `{name}` in place of the name of the body, sensor or controller.
        service_type: ROS type of the service.
        handler: Takes the argument `context` of `serve`, and a request. Returns an Answer, the response, or the
            response's fields. To refuse the request, the handler raises an InterfaceError or ValueError. The client
            then gets `success=False` and the error's message; if the response has no field `success`, the call fails.
            None if other code opens the service.
        owners: Function from a body to the texts that replace `{name}`, one for each service that the body has.
    """

    name: str
    service_type: Any
    handler: Callable[[Any, Any], Any] | None
    owners: Owners = of(Body)

    @property
    def meaning(self) -> str:
        """Purpose of the service: the first paragraph of the handler's docstring."""
        return " ".join((inspect.getdoc(self.handler) or "").split("\n\n")[0].split()) if self.handler else ""


MAX_BYTES = 2_000_000
"""Largest size of YAML text in a request, or of a file that a request names [bytes]; more would delay the
simulation."""
_warn = ThrottledWarning()


def subscribe(topic: Topic, context: Any, owner: str = "") -> rospy.Subscriber:
    """Subscribes to a topic; calls the topic's handler with `context` and the message, for each message.

    Refused messages are logged at a limited rate. The owner's name replaces `{name}` in the topic's name.
    """
    name, handler = rospy.resolve_name(topic.name.format(name=owner)), topic.handler
    assert handler is not None  # rows of topics to subscribe to have one

    def on_message(message: Any) -> None:
        try:
            handler(context, message)
        except (InterfaceError, ValueError) as error:
            _warn(name, f"message refused: {bounded(str(error))}")

    subscriber = rospy.Subscriber(name, topic.message_type, on_message, queue_size=1, tcp_nodelay=True)
    close_poller_with(subscriber)
    return subscriber


def serve(service: Service, context: Any, owner: str = "") -> rospy.Service:
    """Opens a service, whose handler is called with `context` and each request.

    The owner's name replaces `{name}` in the service's name.
    """
    response_type, handler = service.service_type._response_class, service.handler
    assert handler is not None  # rows of services to open have one

    def handle(request: Any) -> Any:
        try:
            answer = handler(context, request)
            return {**answer._asdict(), "message": bounded(answer.message)} if isinstance(answer, Answer) else answer
        except (InterfaceError, ValueError) as error:
            message = bounded(str(error))
            if "success" in response_type.__slots__:
                return response_type(success=False, message=message)
            raise rospy.ServiceException(message) from error

    return rospy.Service(service.name.format(name=owner), service.service_type, handle)


def find_topic(name: str, owner: Any) -> Topic:
    """Imports and returns a `Topic`, possibly one that another package defines.

    Args:
        name: Module and variable of the Topic, as `module:NAME`.
        owner: Sensor, or function that applies an input, whose `ros_topic` is `name`; only used in the error message.

    Raises:
        ConfigError: If the module has no such Topic; the error names the owner.
    """
    try:
        found = find(name)
        if not isinstance(found, Topic):
            raise ValueError(f"expected a {full_name(Topic)} in '{name}', got {found!r}")
    except ValueError as error:
        raise ConfigError([Problem(full_name(owner), "ros_topic", str(error))]) from None
    return found
