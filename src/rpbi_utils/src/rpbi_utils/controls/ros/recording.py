"""Panel that records topics and labels into a bag."""

import time
from pathlib import Path

import rospy
from PyQt5.QtWidgets import QCheckBox, QGridLayout, QLineEdit, QPushButton
from std_msgs.msg import String

from rpbi_data.bags.recorded_topics import Recorder
from rpbi_utils.controls.requests import BackgroundRequests, RequestResult
from rpbi_utils.plain_text import plain_label

from .link import SimulatorLink, SimulatorSnapshot
from .panel import Panel, named

FOLDER = "~/rpbi_recordings"
LIMIT_S = 60.0
"""Time limit for subscribing to all topics, and for closing the bag [s]."""
LABEL = "~label"
ALSO = ("/tf", "/tf_static", "/clock", "/diagnostics")
"""Topics that are recorded in addition to those below `rpbi/`."""
IMAGES = ("/image", "/segmentation", "/pointcloud", "/compressed", "/visualizer_image", "/visualizer_image_int")
"""Endings of the names of topics that are recorded only if the user selects `with images`."""


class RecordingPanel(Panel):
    """Records the simulator's topics into a bag, and publishes labels that mark moments in the recording."""

    def __init__(self, link: SimulatorLink, requests: BackgroundRequests) -> None:
        super().__init__("Recording", link, requests)
        self._recorder: Recorder | None = None
        self._is_busy, self._begin_s = False, 0.0
        self._labels = rospy.Publisher(LABEL, String, queue_size=10)
        self._topics: list[str] = []
        self._folder = named(QLineEdit(FOLDER), "folder", "Folder of the bags")
        self._label = named(QLineEdit(), "label", "Start of the file's name; later, text for a moment")
        self._label.setPlaceholderText("label")
        self._images = named(QCheckBox("with images"), "images", "Records images and point clouds, too")
        self._record = named(QPushButton("Record"), "record", "Starts or ends a recording")
        self._record.clicked.connect(self._on_record)
        self._mark = named(QPushButton("Label"), "mark", f"Publishes the label on {rospy.resolve_name(LABEL)}")
        self._mark.clicked.connect(lambda: self._labels.publish(self._label.text()))
        self._told = named(plain_label("not recording"), "recording")
        grid = QGridLayout(self)
        grid.addWidget(plain_label("Folder"), 0, 0)
        grid.addWidget(self._folder, 0, 1)
        grid.addWidget(self._images, 0, 2)
        grid.addWidget(plain_label("Label"), 1, 0)
        grid.addWidget(self._label, 1, 1)
        grid.addWidget(self._mark, 1, 2)
        grid.addWidget(self._told, 2, 0, 1, 2)
        grid.addWidget(self._record, 2, 2)

    def refresh(self, snapshot: SimulatorSnapshot) -> None:
        super().refresh(snapshot)
        own = rospy.resolve_name(LABEL)
        ours = rospy.resolve_name("rpbi") + "/"
        self._topics = sorted(
            topic
            for topic in snapshot.topics | {own}
            if (topic.startswith(ours) or topic in ALSO or topic == own)
            and (self._images.isChecked() or not topic.endswith(IMAGES))
        )
        records = self._recorder is not None
        self._record.setText("End" if records else "Record")
        self._record.setEnabled(not self._is_busy and (records or snapshot.is_alive))
        self._mark.setEnabled(records and not self._is_busy and bool(self._label.text()))
        self._images.setEnabled(not records)
        self._folder.setEnabled(not records)
        if self._recorder is not None and not self._is_busy:
            size_mb = sum(path.stat().st_size for path in self._files(self._recorder) if path.exists()) / 1e6
            seconds = time.monotonic() - self._begin_s
            self._told.setText(f"{self._recorder.path.name}: {seconds:.0f} s, {size_mb:.1f} MB")

    def close(self) -> bool:
        """Ends a running recording, waits until its bag is closed, and closes the panel."""
        if self._recorder is not None:
            self._recorder.stop()
        return super().close()

    def _on_record(self) -> None:
        self._is_busy = True
        if self._recorder is not None:
            self._told.setText("closing the bag")
            self.ask("Recording", self._recorder.stop, self._on_ended, LIMIT_S)
            return
        stem = "_".join([*self._label.text().split(), time.strftime("%Y%m%d_%H%M%S")]).replace("/", "_")
        self._recorder = Recorder(Path(self._folder.text()).expanduser() / f"{stem}.bag", self._topics)
        self._told.setText("subscribing")
        self.ask(f"Record {stem}.bag", self._recorder.start, self._on_begun, LIMIT_S)

    def _on_begun(self, outcome: RequestResult) -> None:
        self._is_busy, self._begin_s = False, time.monotonic()
        if outcome.error:
            self._recorder = None
            self._told.setText("not recording")

    def _on_ended(self, outcome: RequestResult) -> None:
        self._is_busy, self._recorder = False, None
        self._told.setText("not recorded" if outcome.error else f"saved {outcome.value}")

    def _files(self, recorder: Recorder) -> tuple[Path, Path]:
        return recorder.path, recorder.path.with_name(recorder.path.name + ".active")
