"""Shows untrusted texts in Qt windows unformatted. Otherwise Qt would render HTML, and load the files named there."""

from html import escape

from PyQt5.QtCore import Qt
from PyQt5.QtWidgets import QLabel


def plain_label(text: str = "") -> QLabel:
    """Returns a label that shows its text unformatted."""
    label = QLabel(text)
    label.setTextFormat(Qt.TextFormat.PlainText)
    return label


def plain_tip(text: str) -> str:
    """Returns a text for a tool tip, with HTML escaped. Qt offers no option to show tool tips unformatted."""
    return f"<qt>{escape(text)}</qt>" if "<" in text else text
