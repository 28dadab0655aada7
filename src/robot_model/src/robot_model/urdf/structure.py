"""Finds faults in the structure of a URDF that PyBullet would accept silently, or that would crash PyBullet."""

import math
import re
from collections import Counter
from collections.abc import Iterator
from functools import lru_cache
from itertools import islice

from custom_ros_tools.errors import ConfigError, Problem, shortened
from custom_ros_tools.schema import HEAVIEST_KG, MAX_COORDINATE_M
from robot_model.limits import MAX_MAGNITUDE

from .document import Attribute, UrdfDocument
from .elements import READ, Element

LONGEST_NAME = 250
"""Largest length of a name [bytes]. PyBullet copies names into buffers of 1024 bytes on the stack."""
LONGEST_TEXT = 1000
"""Largest length of any other attribute value, including file names [bytes]."""
MAX_LINKS = 2000
"""Largest number of links, including links on fixed joints. Larger robots are refused."""
MAX_SHAPES = 1000
"""Largest number of visual and collision shapes, summed over all links."""
MAX_ATTRIBUTES = 100_000
"""Largest number of XML attributes in a file. A file with more attributes is faulty; the others are not checked."""
MAX_PROBLEMS = 20
"""Largest number of faults that are reported for one file."""
_NAMES = {("robot", "name"), ("link", "name"), ("joint", "name"), ("material", "name"), ("joint", "type")}
_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical")
_UNSAFE = re.compile(r"[%\x00-\x1f\x7f-\x9f]")
"""Characters that are not allowed in attribute values: control characters, and %, since PyBullet's log uses values as
format strings of printf."""
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*(e[-+]?\d+)?|\.\d+(e[-+]?\d+)?|nan|inf(inity)?)", re.IGNORECASE)
_NUMBERS = {
    **dict.fromkeys((("origin", "xyz"), ("box", "size"), ("sphere", "radius")), MAX_COORDINATE_M),
    **{(tag, key): MAX_COORDINATE_M for tag in ("cylinder", "capsule") for key in ("radius", "length")},
    **dict.fromkeys((("origin", "rpy"), ("axis", "xyz"), ("mesh", "scale")), MAX_MAGNITUDE),
    ("mass", "value"): HEAVIEST_KG,
    **{("inertia", key): MAX_MAGNITUDE for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")},
    **{("dynamics", key): MAX_MAGNITUDE for key in ("damping", "friction")},
    **{("limit", key): math.inf for key in ("lower", "upper", "effort", "velocity")},
    **dict.fromkeys((("color", "rgba"), ("specular", "rgb")), MAX_MAGNITUDE),
    **{
        (tag, "value"): MAX_MAGNITUDE
        for tag in (
            *("lateral_friction", "rolling_friction", "spinning_friction", "restitution", "inertia_scaling"),
            *("stiffness", "damping", "collision_margin", "friction", "repulsion_stiffness", "gravity_factor"),
        )
    },
}
"""Largest allowed magnitude of a number, indexed by tag and attribute name."""
_VECTORS = {("origin", "xyz"), ("origin", "rpy"), ("axis", "xyz"), ("box", "size")}
"""Tags and names of the attributes that must have three numbers."""
_SHAPES = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "plane": ("normal",),
    "mesh": ("filename",),
}
"""Required attributes of each shape, indexed by tag."""
_LIMITED = ("revolute", "prismatic")
_INERTIA = ("ixx", "iyy", "izz")
_CONTACT = (
    *("inertia_scaling", "lateral_friction", "rolling_friction", "spinning_friction", "restitution"),
    *("stiffness", "damping"),
)


def check_structure(document: UrdfDocument) -> None:
    """Checks that PyBullet and other programs can load a URDF safely.

    Raises:
        ConfigError: If the URDF has faults; the error lists up to `MAX_PROBLEMS` faults.
    """
    if problems := structure_problems(document):
        raise ConfigError([Problem(document.path, "", problem) for problem in problems])


@lru_cache(maxsize=32)
def structure_problems(document: UrdfDocument) -> tuple[str, ...]:
    """Returns up to `MAX_PROBLEMS` messages, one for each fault in the link tree, names, numbers or texts of a URDF."""
    return tuple(islice(_problems(document), MAX_PROBLEMS))


def _problems(document: UrdfDocument) -> Iterator[str]:
    if len(document.links) > MAX_LINKS or len(document.edges) > MAX_LINKS:
        counts = f"{len(document.links)} links and {len(document.edges)} joints"
        yield f"expected at most {MAX_LINKS} links and as many joints, got {counts}"
        return
    if (shapes := sum(1 for _ in document.root.iter("geometry"))) > MAX_SHAPES:
        yield f"expected at most {MAX_SHAPES} shapes, got {shapes}"
    yield from _name_problems(document)
    yield from _type_problems(document)
    yield from _tree_problems(document)
    yield from _mimic_problems(document)
    yield from _text_problems(document)


def _name_problems(document: UrdfDocument) -> Iterator[str]:
    for kind, names in (("link", document.links), ("joint", [edge.joint for edge in document.edges])):
        for name, count in Counter(names).items():
            if not name:
                yield f"a {kind} has no name"
            elif count > 1:
                yield f"{count} {kind}s are called '{shortened(name)}'; names are unique"


def _type_problems(document: UrdfDocument) -> Iterator[str]:
    """Yields a message for each joint without a valid type, since PyBullet's own message for this fault is broken."""
    for joint in document.joint_elements:
        if (kind := joint.get("type", "")) not in _TYPES:
            name = shortened(joint.get("name", ""))
            yield f"joint '{name}': type: expected one of {', '.join(_TYPES)}, got {shortened(ascii(kind))}"


def _tree_problems(document: UrdfDocument) -> Iterator[str]:
    links, parents = set(document.links), {}
    for joint, parent, child in document.edges:
        if parent not in links or child not in links:
            missing = parent if parent not in links else child
            yield f"joint '{shortened(joint)}' connects link '{shortened(missing)}', which does not exist"
        elif parent == child:
            yield f"joint '{shortened(joint)}' connects link '{shortened(child)}' to itself"
        elif child in parents:
            yield f"link '{shortened(child)}' is the child of two joints; the second is '{shortened(joint)}'"
        else:
            parents[child] = parent
    roots = [shortened(link) for link in document.links if link not in parents]
    if len(roots) > 1:
        yield f"expected one link that is no joint's child, got {', '.join(roots[:5])}: is a joint missing?"
    reaching: set[str] = {link for link in links if link not in parents}
    for link in document.links:
        passed: dict[str, None] = {}
        while link not in reaching and link in parents and link not in passed:
            passed[link] = None
            link = parents[link]
        if link in passed:
            yield f"link '{shortened(link)}' is its own ancestor"
        reaching.update(passed)


def _mimic_problems(document: UrdfDocument) -> Iterator[str]:
    leaders = {
        joint.get("name", ""): mimic.get("joint", "")
        for joint in document.joint_elements
        if (mimic := joint.find("mimic")) is not None
    }
    for joint in leaders:
        line, leader = {joint}, leaders[joint]
        while leader in leaders and leader not in line:
            line.add(leader)
            leader = leaders[leader]
        if leader == joint:
            yield f"joint '{shortened(joint)}' mimics itself in the end"


def _text_problems(document: UrdfDocument) -> Iterator[str]:
    for count, attribute in enumerate(document.attributes()):
        owner, tag, key, text, is_read = attribute
        place = f"{owner}: {shortened(tag)}.{shortened(key)}"
        if count == MAX_ATTRIBUTES:
            yield f"expected at most {MAX_ATTRIBUTES} attributes, got more"
            return
        if tag.startswith("xacro:") or "${" in text:
            left = f"<{shortened(tag)}>" if tag.startswith("xacro:") else f"'{shortened(text)}'"
            yield f"{place}: {left} is unexpanded xacro: expected a URDF, as the program xacro writes it"
        elif is_read and (problem := _text_problem(attribute)):
            yield f"{place}: {problem}"
        elif (tag, key) in _NUMBERS and (problem := _number_problem(tag, key, text)):
            yield f"{place}: {problem}, got '{shortened(text)}'"


def _text_problem(attribute: Attribute) -> str:
    """Returns why a text is unsafe for PyBullet, which copies it to its stack and log; empty for a safe text."""
    _, tag, key, text, _ = attribute
    longest = LONGEST_NAME if (tag, key) in _NAMES or key == "link" else LONGEST_TEXT
    if (size := len(text.encode())) > longest:
        return f"expected at most {longest} bytes, got {size}: '{shortened(text)}'"
    if _UNSAFE.search(text):
        return f"expected a text without % and control characters, got {shortened(ascii(text))}"
    return ""


def numbers_in(text: str) -> list[float]:
    """Reads numbers like PyBullet: reads the number at the beginning of each word, and skips other words."""
    return [float(match[0]) for word in text.split() if (match := _NUMBER.match(word))]


def _number_problem(tag: str, key: str, text: str) -> str:
    largest, numbers = _NUMBERS[tag, key], numbers_in(text)
    if not numbers or len(numbers) < len(text.split()):
        return "expected numbers"
    if any(map(math.isnan, numbers)):
        return "expected finite numbers"
    if any(abs(number) > largest for number in numbers):
        return f"must be within +-{largest:g}"
    if (tag, key) in _VECTORS and len(numbers) < 3:
        return "expected three numbers"
    if (tag, key) == ("mass", "value") and numbers[0] < 0.0:
        return "must be >= 0 [kg]"
    return ""


def missing_parts(document: UrdfDocument) -> Iterator[str]:
    """Yields a message for each missing element or attribute that PyBullet requires.

    The message names the link or joint, while PyBullet's own message is only "Cannot load URDF file".
    """
    if "name" not in document.root.attrib:
        yield "<robot> has no name"
    for link in document.root.iterfind("link"):
        for fault in _link_faults(link):
            yield f"link '{shortened(link.get('name', ''))}': {fault}"
    for joint in document.joint_elements:
        for fault in _joint_faults(joint):
            yield f"joint '{shortened(joint.get('name', ''))}': {fault}"


def _joint_faults(joint: Element) -> Iterator[str]:
    if (kind := joint.get("type")) in _LIMITED and joint.find("limit") is None:
        hint = ", or type continuous" if kind == "revolute" else ""
        yield f'a {kind} joint needs <limit lower="" upper="" effort="" velocity=""/>{hint}'
    dynamics = joint.find("dynamics")
    if dynamics is not None and not dynamics.attrib.keys() & {"damping", "friction"}:
        yield "<dynamics> needs damping or friction"


def _link_faults(link: Element) -> Iterator[str]:
    if (inertial := link.find("inertial")) is not None:
        yield from _lacking(inertial, "mass", ("value",))
        yield from _lacking(inertial, "inertia", _INERTIA)
    if (contact := link.find("contact")) is not None:
        for tag in _CONTACT:
            yield from _lacking(contact, tag, ("value",)) if contact.find(tag) is not None else ()
    for part in ("visual", "collision"):
        for element in link.iterfind(part):
            yield from _shape_faults(element)
    for material in link.iterfind("visual/material"):
        if "name" not in material.attrib:
            yield "visual: <material> has no name"


def _shape_faults(part: Element) -> Iterator[str]:
    """Yields a message for each required part that the first shape of a visual or collision element lacks.

    PyBullet only reads the first shape.
    """
    shapes = [shape for shape in part.iterfind("geometry/*") if shape.tag in READ]
    if not shapes:
        given = [f", got <{shortened(shape.tag)}>" for shape in part.iterfind("geometry/*")][:1]
        yield f"{part.tag}: <geometry> needs one of {', '.join(_SHAPES)}{''.join(given)}"
        return
    for key in _SHAPES.get(shapes[0].tag, ()):
        if key not in shapes[0].attrib:
            yield f"{part.tag}: <{shapes[0].tag}> has no {key}"


def _lacking(owner: Element, tag: str, keys: tuple[str, ...]) -> Iterator[str]:
    """Yields a message if the element `tag` inside `owner` is missing, or lacks some of the attributes `keys`."""
    if (found := owner.find(tag)) is None:
        yield f"<{owner.tag}> has no <{tag}>"
        return
    if lacking := [key for key in keys if key not in found.attrib]:
        yield f"{owner.tag}: <{tag}> has no {', '.join(lacking)}"
