"""Texts of other people in Qt windows: Qt would show those that look like HTML as such, with files that they name."""

from html import escape

from PyQt5.QtCore import Qt
from PyQt5.QtWidgets import QLabel


def plain_label(text: str = "") -> QLabel:
    """Returns a label that shows all texts as they are."""
    label = QLabel(text)
    label.setTextFormat(Qt.TextFormat.PlainText)
    return label


def plain_tip(text: str) -> str:
    """Returns the text of a tool tip that shows a text as it is; tool tips have no format."""
    return f"<qt>{escape(text)}</qt>" if "<" in text else text
