"""Rows of the tables of topics and services, used by the node and by the reference pages."""

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
"""Returns the values of `{name}` for the endpoints that a body has by a row; none if it has none."""


class Answer(NamedTuple):
    """Answer of most services, whose types have the two fields in different orders."""

    success: bool
    message: str


def of(body_type: type[Body]) -> Owners:
    """Returns the owners function of an endpoint that every body of a type has once."""
    return lambda body: (body.name,) if isinstance(body, body_type) else ()


class Topic(NamedTuple):
    """A topic.

    Attributes:
        name: Its name, with `{name}` for the body, sensor or camera.
        message_type: Its ROS type.
        handler: For samples: returns the message of a sample and its stamp [ns]. For an input: returns its value from a
            message. For a body: acts on the body's context and a message. None if something else publishes.
        meaning: Its content, or the effect of a message, in a sentence; with the key that sets its rate.
        key: Key of the main file that opens it or sets its rate, where 0 is off; empty if it is there in any case.
        owners: Bodies that subscribe to it.
        on_tf: For samples: returns poses for TF and their stamp [ns]. None if there are none.
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
        name: Its name, with `{name}` for the body or sensor.
        service_type: Its ROS type.
        handler: Returns the answer to a context and a request: an Answer, or the response or its fields. An
            InterfaceError or ValueError refuses the request: `success=False` and its message, or an error of the call
            where the response has no `success`. None where something else serves it.
        owners: Bodies that have it.
    """

    name: str
    service_type: Any
    handler: Callable[[Any, Any], Any] | None
    owners: Owners = of(Body)

    @property
    def meaning(self) -> str:
        """Its purpose: the first paragraph of its handler's docstring."""
        return " ".join((inspect.getdoc(self.handler) or "").split("\n\n")[0].split()) if self.handler else ""


MAX_BYTES = 2_000_000
"""Largest size of YAML in a request, or in a file that it names [bytes]; larger ones would delay the simulation."""
_warn = ThrottledWarning()


def subscribe(topic: Topic, context: Any, owner: str = "") -> rospy.Subscriber:
    """Subscribes to a topic whose handler acts on a context; refused messages are logged at a limited rate."""
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
    """Opens a service."""
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
    """Returns a topic of another package.

    Args:
        name: Where it is, as `module:NAME`.
        owner: The sensor or body that names it as its `ros_topic`.

    Raises:
        ConfigError: If it does not exist; the error names the class of the owner.
    """
    try:
        found = find(name)
        if not isinstance(found, Topic):
            raise ValueError(f"expected a {full_name(Topic)} in '{name}', got {found!r}")
    except ValueError as error:
        raise ConfigError([Problem(full_name(owner), "ros_topic", str(error))]) from None
    return found
