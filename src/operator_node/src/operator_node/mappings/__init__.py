"""The mappings; a new one is a class in a file of its own and a line here.

A user's own one needs no line: `"their_package.module:Class"` serves wherever a name does.
"""

MAPPINGS: dict[str, str] = {
    "scale": "operator_node.mappings.scale:ScaleMapping",
    "isometric": "operator_node.mappings.isometric:IsometricMapping",
}
"""Class of each mapping; imported when it is asked for."""
