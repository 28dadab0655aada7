"""Shows untrusted texts in Qt windows as plain text. By default, Qt renders HTML and loads files named in the HTML."""

from html import escape

from PyQt5.QtCore import Qt
from PyQt5.QtWidgets import QLabel


def plain_label(text: str = "") -> QLabel:
    """Returns a label that shows its text as plain text."""
    label = QLabel(text)
    label.setTextFormat(Qt.TextFormat.PlainText)
    return label


def plain_tip(text: str) -> str:
    """Escapes HTML in the text of a tool tip. Qt has no option to show tool tips as plain text."""
    return f"<qt>{escape(text)}</qt>" if "<" in text else text
