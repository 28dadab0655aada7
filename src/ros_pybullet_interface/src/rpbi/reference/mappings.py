"""Which mappings inside of YAML files are told where on a page."""

from __future__ import annotations

import json
from collections.abc import Container, Iterator, Mapping
from typing import NamedTuple

from custom_ros_tools.schema.json_schema import Schema

from .type_words import mapping_in


class Place(NamedTuple):
    """A mapping and where it is told.

    Attributes:
        heading: The heading.
        schema: The mapping.
        files: Kinds of the files that have it.
    """

    heading: str
    schema: Schema
    files: tuple[str, ...]


class Mappings:
    """Gives each mapping with keys of its own a heading: its path in the file that has it.

    Args:
        files: Schema of each kind of file.
    """

    def __init__(self, files: Mapping[str, Schema]) -> None:
        self._places: dict[str, Place] = {}
        whole = {_essence(schema): kind for kind, schema in files.items()}
        for kind, schema in files.items():
            for path, mapping in _inside(schema, "", whole):
                essence = _essence(mapping)
                if essence in whole:
                    self._places[essence] = Place(whole[essence], mapping, ())
                    continue
                known = self._places.setdefault(essence, Place(path, mapping, ()))
                self._places[essence] = known._replace(files=tuple(dict.fromkeys((*known.files, kind))))

    def heading_of(self, mapping: Schema) -> str:
        """Returns where a mapping is told."""
        return self._places[_essence(mapping)].heading

    def of(self, kind: str) -> list[Place]:
        """Returns those that only one kind of file has."""
        return [place for place in self._places.values() if place.files == (kind,)]

    def shared(self) -> list[Place]:
        """Returns those that several kinds of files have, by heading."""
        shared = [place for place in self._places.values() if len(place.files) > 1]
        return sorted(shared, key=lambda place: place.heading.lower())


def is_list_of_files(schema: Schema) -> bool:
    """Tells whether a key takes files of objects, or mappings with the keys that differ."""
    return schema.get("type") == "array" and schema["items"].get("expects") == "a list of files"


def _inside(schema: Schema, path: str, skipped: Container[str]) -> Iterator[tuple[str, Schema]]:
    """Yields the mappings inside of one, with their paths, but for what is inside of some that are told elsewhere."""
    values = {f"{path}{key}": value for key, value in schema.get("properties", {}).items()}
    if isinstance(schema.get("additionalProperties"), dict):
        values[f"{path}NAME"] = schema["additionalProperties"]
    for inner_path, value in values.items():
        mapping = None if is_list_of_files(value) else mapping_in(value)
        if mapping is not None:
            yield inner_path, mapping
            if _essence(mapping) not in skipped:
                yield from _inside(mapping, f"{inner_path}.", skipped)


def _essence(mapping: Schema) -> str:
    """Returns a text that is the same for mappings with the same keys, but for those of older worlds."""
    keys = {key: value for key, value in mapping["properties"].items() if "deprecated" not in value}
    return json.dumps([keys, mapping.get("required"), mapping.get("additionalProperties")], sort_keys=True)
