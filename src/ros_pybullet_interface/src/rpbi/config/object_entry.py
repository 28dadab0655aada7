"""Entries of the main file's lists: files of objects, and instances of one file that differ in some keys."""

import copy
from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

from pydantic import AfterValidator, WithJsonSchema

from custom_ros_tools.schema import Expects
from custom_ros_tools.schema.type_names import shown

FILE = "file"


class ObjectEntry(NamedTuple):
    """One object: its file, and what is different for it.

    Attributes:
        file: The file as the user wrote it.
        overrides: Keys and values that replace those of the file; mappings are merged key by key, and null removes a
            key.
    """

    file: str
    overrides: Mapping[str, Any]

    def apply_overrides(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """Returns the file's content with the overrides applied; neither is altered."""
        return _merged(data, self.overrides)


def parse_object_entry(entry: Any) -> ObjectEntry:
    """Reads one entry of a list of objects: a file name, or a mapping with `file` and the keys that differ.

    Raises:
        ValueError: If it is neither.
    """
    file = entry.get(FILE) if isinstance(entry, Mapping) else entry
    if not isinstance(file, str) or not file:
        expected = f"expected a file name, or a mapping with '{FILE}' and the keys that differ"
        raise ValueError(f"{expected}; got {shown(entry)}")
    overrides = {key: value for key, value in entry.items() if key != FILE} if isinstance(entry, Mapping) else {}
    return ObjectEntry(file, overrides)


def _merged(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    result = copy.deepcopy(dict(data))
    for key, value in overrides.items():
        old = result.get(key)
        if value is None:
            result.pop(key, None)
        elif isinstance(old, Mapping) and isinstance(value, Mapping):
            result[key] = _merged(old, value)
        else:
            result[key] = copy.deepcopy(value)
    return result


def _check(entry: Any) -> Any:
    parse_object_entry(entry)
    return entry


FILES = "a list of files"
FileOrOverrides = Annotated[
    Any,
    AfterValidator(_check),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "object", "required": [FILE]}]}),
    Expects(FILES),  # error text for the list; the validator reports errors of entries
]
"""A file of an object, or `{file: FILE, KEY: VALUE, ...}`."""
