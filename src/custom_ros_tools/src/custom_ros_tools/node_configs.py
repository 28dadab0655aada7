"""What the nodes of this package may be told in `~config`, by node."""

from __future__ import annotations

from .float_array_config import FloatArrayConfig
from .marker_config import MarkerConfig
from .schema import ConfigModel

NODE_CONFIGS: dict[str, type[ConfigModel]] = {
    "attach_marker": MarkerConfig,
    "remap_joint_state_to_floatarray": FloatArrayConfig,
}
