"""Saves learned primitives in YAML files, and loads and checks these files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from pydantic import Field

from custom_ros_tools.config import load_config
from custom_ros_tools.errors import ConfigError, InterfaceError, Problem
from custom_ros_tools.files import atomic_file
from custom_ros_tools.schema import ConfigModel, ListOf, Switch, Text

from .primitive import Primitive
from .primitives import PRIMITIVES
from .space import Space


class PrimitiveFile(ConfigModel):
    """Content of a file with a learned primitive."""

    type: Text = Field(description="Type of the primitive: a name of the table of primitives, or `module:Class`.")
    options: dict[Text, Any] = Field({}, description="Options of the type.")
    names: ListOf[Text] = Field(min_length=1, description="Names of the positions.")
    orientation: Switch = Field(False, description="Whether points contain an orientation after the positions.")
    learned: dict[Text, Any] = Field(description="Learned data, in the form of the type.")


def save(primitive: Primitive, path: str | Path) -> None:
    """Writes a learned primitive to a file.

    An existing file is replaced atomically; if writing fails, the existing file does not change.

    Raises:
        NotLearnedError: If the primitive has not learned yet.
        OSError: If the file cannot be written.
    """
    content = PrimitiveFile(
        type=PRIMITIVES.name_of(primitive),
        options=primitive.config.model_dump(mode="json"),
        names=primitive.space.names,
        orientation=primitive.space.has_orientation,
        learned=primitive.learned().model_dump(mode="json"),
    )
    text = yaml.safe_dump(content.model_dump(mode="json"), sort_keys=False, default_flow_style=None, width=120)
    with atomic_file(Path(path)) as part:
        part.write_text(text, encoding="utf-8")


def load(path: str | Path) -> Primitive:
    """Reads a learned primitive from a file.

    Raises:
        ConfigError: If the file cannot be read or is invalid; the message names the file and the key of each fault.
        UnknownNameError: If the file names an unknown type of primitive.
    """
    file = str(path)
    content = PrimitiveFile.parse(load_config(file), file)
    primitive = PRIMITIVES.make(content.type, content.options, file)
    try:
        learned = primitive.Learned.parse(content.learned, file)
        primitive.restore(Space(tuple(content.names), content.orientation), learned)
    except ConfigError as error:
        raise ConfigError(
            [Problem(each.file, f"learned.{each.key}", each.message) for each in error.problems]
        ) from None
    except (InterfaceError, ValueError) as error:
        raise ConfigError([Problem(file, "learned", str(error))]) from None
    return primitive
