"""Texts that look like HTML are shown as they are, in real windows on a virtual screen."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

SRC = Path(__file__).resolve().parents[3] / "src"
PROGRAM = """
import json
from PyQt5.QtWidgets import QApplication, QLabel
from rpbi_utils.plain_text import plain_label, plain_tip

app = QApplication([])
name = "<table width=900><tr><td>ball</td></tr></table>"
labels = QLabel(name), plain_label(name), plain_label()
labels[2].setText(name)
for label in labels:
    label.show()
app.processEvents()
tip = plain_tip(name)
print(json.dumps([[label.sizeHint().width() for label in labels], tip, plain_tip("a tip")]))
"""


def test_a_name_with_tags_is_shown_as_it_is(screen):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env={**os.environ, **screen.environment},
        capture_output=True,
        text=True,
        check=True,
    )
    (rich, plain, changed), tip, simple = json.loads(done.stdout)
    assert rich >= 900, "the control is laid out as a table"
    assert plain == changed < 900
    assert tip.startswith("<qt>&lt;table width=900&gt;") and simple == "a tip"


def test_all_labels_and_tips_are_plain():
    for file in SRC.rglob("*.py"):
        text = file.read_text()
        if file.name != "plain_text.py":
            assert "QLabel(" not in text and "QMessageBox" not in text, file
            assert text.count("setToolTip(") == text.count("setToolTip(plain_tip("), file
