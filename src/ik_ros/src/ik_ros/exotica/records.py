"""Reads EXOTica's XML into plain records, without expanding entities or loading other files."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple
from xml.parsers import expat

from custom_ros_tools.config import read_file
from custom_ros_tools.errors import ConfigError, Problem, shortened
from custom_ros_tools.foreign import MAX_DEPTH, printable

MAX_BYTES = 1_000_000
"""Largest length of a file [bytes]."""
MAX_ELEMENTS = 10_000


class XmlRecord(NamedTuple):
    """An XML element with fields.

    Attributes:
        kind: Tag of the element, such as `EffFrame`.
        fields: Value of each XML attribute and of each child element, indexed by name. The value of a child element is
            the element's text, or a list of nested child elements.
    """

    kind: str
    fields: dict[str, str | list[XmlRecord]]


@dataclass
class _Element:
    tag: str
    attributes: dict[str, str]
    children: list[_Element] = field(default_factory=list)
    text: str = ""


def read_records(path: str) -> list[XmlRecord]:
    """Reads the elements directly below the top element of a file.

    Raises:
        ConfigError: If the file cannot be read, is too large or nested too deeply, is not XML, or has a DOCTYPE.
    """
    try:
        return [_record(element, element.tag) for element in _parse(read_file(path, MAX_BYTES)).children]
    except OSError as error:
        message = (error.strerror or str(error)).lower()
    except expat.ExpatError as error:
        message = f"is not XML: {error}"
    except ValueError as error:
        message = str(error)
    raise ConfigError([Problem(path, "", shortened(printable(message)))])


def _parse(content: bytes) -> _Element:
    """Parses XML, and returns the top element."""
    document = _Element("", {})
    open_elements, count = [document], 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if len(open_elements) > MAX_DEPTH or count > MAX_ELEMENTS:
            raise ValueError(f"expected at most {MAX_DEPTH} levels and {MAX_ELEMENTS} elements")
        element = _Element(tag, attributes)
        open_elements[-1].children.append(element)
        open_elements.append(element)

    def end(_: str) -> None:
        open_elements.pop()

    def add_text(text: str) -> None:
        open_elements[-1].text += text

    def refuse_doctype(*_: object) -> None:
        raise ValueError("expected no DOCTYPE: entities are not expanded")

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = add_text
    parser.StartDoctypeDeclHandler = refuse_doctype
    parser.Parse(content, True)
    return document.children[0]


def _record(element: _Element, where: str) -> XmlRecord:
    fields: dict[str, str | list[XmlRecord]] = dict(element.attributes)
    for child in element.children:
        if child.tag in fields:
            raise ValueError(f"{where}: '{child.tag}' is given twice")
        inner = f"{where}.{child.tag}"
        fields[child.tag] = [_record(each, f"{inner}.{each.tag}") for each in child.children] or child.text.strip()
    return XmlRecord(element.tag, fields)
