"""Untrusted texts in Qt windows: Qt would render HTML in them, with the files that it refers to."""

from html import escape

from PyQt5.QtCore import Qt
from PyQt5.QtWidgets import QLabel


def plain_label(text: str = "") -> QLabel:
    """Returns a label that shows texts unformatted."""
    label = QLabel(text)
    label.setTextFormat(Qt.TextFormat.PlainText)
    return label


def plain_tip(text: str) -> str:
    """Returns the escaped text of a tool tip; tool tips cannot switch off formatting."""
    return f"<qt>{escape(text)}</qt>" if "<" in text else text
