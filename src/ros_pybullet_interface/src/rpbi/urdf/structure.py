"""What in a URDF makes no robot, though PyBullet may take it, or die of it."""

import math
import re
from collections import Counter
from collections.abc import Iterator

from custom_ros_tools.errors import shortened
from custom_ros_tools.schema import FARTHEST_M, HEAVIEST_KG

from .document import UrdfDocument
from .joints import LARGEST

LONGEST_NAME = 250
"""Characters of a name; PyBullet copies names into fixed places on the stack."""
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*(e[-+]?\d+)?|\.\d+(e[-+]?\d+)?|nan|inf(inity)?)", re.IGNORECASE)
_NUMBERS = {
    **dict.fromkeys((("origin", "xyz"), ("box", "size"), ("sphere", "radius")), FARTHEST_M),
    **{(tag, key): FARTHEST_M for tag in ("cylinder", "capsule") for key in ("radius", "length")},
    **dict.fromkeys((("origin", "rpy"), ("axis", "xyz"), ("mesh", "scale")), LARGEST),
    ("mass", "value"): HEAVIEST_KG,
    **{("inertia", key): LARGEST for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")},
    **{("dynamics", key): LARGEST for key in ("damping", "friction")},
    **{("limit", key): math.inf for key in ("lower", "upper", "effort", "velocity")},
}
"""The largest number by element and attribute."""


def structure_problems(document: UrdfDocument) -> Iterator[str]:
    """Yields a sentence for each fault: in what hangs on what, in names and in numbers."""
    yield from _name_problems(document)
    yield from _tree_problems(document)
    yield from _text_problems(document)


def _name_problems(document: UrdfDocument) -> Iterator[str]:
    for kind, names in (("link", document.links), ("joint", [edge.joint for edge in document.edges])):
        for name, count in Counter(names).items():
            if not name:
                yield f"a {kind} has no name"
            elif count > 1:
                yield f"{count} {kind}s are called '{shortened(name)}'; names are unique"
            elif len(name.encode()) > LONGEST_NAME:
                yield f"expected names of at most {LONGEST_NAME} bytes, got {kind} '{shortened(name)}'"


def _tree_problems(document: UrdfDocument) -> Iterator[str]:
    links, parents = set(document.links), {}
    for joint, parent, child in document.edges:
        if parent not in links or child not in links:
            missing = parent if parent not in links else child
            yield f"joint '{shortened(joint)}' ties link '{shortened(missing)}', which there is not"
        elif parent == child:
            yield f"joint '{shortened(joint)}' ties link '{shortened(child)}' to itself"
        elif child in parents:
            yield f"link '{shortened(child)}' hangs on two joints; the second is '{shortened(joint)}'"
        else:
            parents[child] = parent
    roots = [shortened(link) for link in document.links if link not in parents]
    if len(roots) > 1:
        yield f"expected one link that hangs on no joint, got {', '.join(roots[:5])}: is a joint missing?"
    reaching: set[str] = {link for link in links if link not in parents}
    for link in document.links:
        way = []
        while link not in reaching and link in parents and link not in way:
            way.append(link)
            link = parents[link]
        if link in way:
            yield f"link '{shortened(link)}' hangs on itself in the end"
        reaching.update(way)


def _text_problems(document: UrdfDocument) -> Iterator[str]:
    for owner, tag, key, text in document.attributes():
        what = f"{owner}: {shortened(tag)}.{shortened(key)}"
        if tag.startswith("xacro:") or "${" in text:
            left = f"<{shortened(tag)}>" if tag.startswith("xacro:") else f"'{shortened(text)}'"
            yield f"{what}: {left} is left of xacro: expected a URDF, as the program xacro makes it"
        elif (tag, key) in _NUMBERS and (problem := _number_problem(text, _NUMBERS[tag, key])):
            yield f"{what}: {problem}, got '{shortened(text)}'"
        elif (tag, key) == ("mass", "value") and _number(text.strip() or "0") < 0.0:
            yield f"{what}: must be >= 0 [kg], got '{shortened(text)}'"


def texts_for_numbers(document: UrdfDocument) -> list[str]:
    """Returns where a text stands in the place of a number; PyBullet takes it for 0."""
    return [
        f"{owner}: {tag}.{key} '{shortened(text)}'"
        for owner, tag, key, text in document.attributes()
        if (tag, key) in _NUMBERS and not all(map(_NUMBER.match, text.split()))
    ]


def _number_problem(text: str, largest: float) -> str:
    for number in map(_number, text.split()):
        if math.isnan(number):
            return "expected finite numbers"
        if abs(number) > largest:
            return f"must be within +-{largest:g}"
    return ""


def _number(word: str) -> float:
    """Returns the number that a word begins with, 0 if it begins with none, as PyBullet reads it."""
    match = _NUMBER.match(word)
    return float(match[0]) if match else 0.0
