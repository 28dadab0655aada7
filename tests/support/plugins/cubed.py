"""What users write: a mapping of their own."""

from operator_node.mappings.mapping import AxesConfig, Mapping


class Cubed(Mapping):
    """One axis, finer near its middle."""

    Config = AxesConfig
    size = 1

    def __init__(self, config: AxesConfig) -> None:
        self._config = config

    def map(self, axes):
        """Returns the signal."""
        (axis,) = self._config.pick(axes)
        return (axis**3,)
