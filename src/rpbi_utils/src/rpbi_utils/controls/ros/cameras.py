"""Panel with the image of a camera."""

from typing import Any

import rospy
from PyQt5.QtCore import Qt
from PyQt5.QtGui import QPixmap
from PyQt5.QtWidgets import QComboBox, QSizePolicy, QVBoxLayout

from rpbi_utils.controls.requests import BackgroundRequests
from rpbi_utils.plain_text import plain_label

from .link import IMAGE, SimulatorLink, SimulatorSnapshot
from .panel import Panel, named

NONE = "none"


class CamerasPanel(Panel):
    """Shows the colour image of the selected camera. Without a selection, the panel stays empty."""

    def __init__(self, link: SimulatorLink, requests: BackgroundRequests) -> None:
        super().__init__("Cameras", link, requests)
        self._choice = named(QComboBox(), "camera", "Camera whose colour image is shown")
        self._choice.addItem(NONE)
        self._image = named(plain_label(), "image")
        self._image.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._image.setSizePolicy(QSizePolicy.Ignored, QSizePolicy.Ignored)
        self._image.setMinimumHeight(150)
        layout = QVBoxLayout(self)
        layout.addWidget(self._choice)
        layout.addWidget(self._image, 1)
        self._shown: Any = None

    def refresh(self, snapshot: SimulatorSnapshot) -> None:
        super().refresh(snapshot)
        offered = [NONE, *snapshot.cameras]
        if offered != [self._choice.itemText(index) for index in range(self._choice.count())]:
            chosen = self._choice.currentText()
            self._choice.clear()
            self._choice.addItems(offered)
            self._choice.setCurrentText(chosen if chosen in offered else NONE)
        self._choice.setEnabled(len(offered) > 1)
        camera = self._choice.currentText()
        is_none = camera == NONE
        self.link.follow(self.link.image, "" if is_none else rospy.resolve_name(f"rpbi/{camera}{IMAGE}"))
        message = self.link.image.message
        if message is None:
            self._image.setText("" if is_none else "no image yet; a stopped world sends none")
            self._shown = None
        elif message is not self._shown:
            self._shown = message
            picture = QPixmap()
            picture.loadFromData(bytes(message.data))
            size = self._image.size()
            self._image.setPixmap(
                picture.scaled(size, Qt.AspectRatioMode.KeepAspectRatio, Qt.TransformationMode.SmoothTransformation)
            )
