"""Entries of object lists in the main YAML file. An entry names an object's file and may override the file's keys."""

import copy
from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

from pydantic import AfterValidator, WithJsonSchema

from custom_ros_tools.schema import Expects
from custom_ros_tools.schema.type_names import shown

FILE = "file"


class ObjectEntry(NamedTuple):
    """The file of an object, and overrides of the file's keys.

    Attributes:
        file: Name of the file, as in YAML.
        overrides: Values that replace the file's values, keyed as in the file. Mappings are merged key by key, and null
            removes a key.
    """

    file: str
    overrides: Mapping[str, Any]

    def apply_overrides(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """Returns a copy of a file's content with the overrides applied.

        Args:
            data: Content of the file.
        """
        return _merged(data, self.overrides)


def parse_object_entry(entry: Any) -> ObjectEntry:
    """Parses one entry of a list of objects.

    Args:
        entry: A file name, or a mapping with the key `file` and the keys to override.

    Raises:
        ValueError: If the entry is neither a file name nor such a mapping.
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
"""An entry of a list of objects: a file name, or `{file: FILE, KEY: VALUE, ...}`."""
