"""Panel that lists, adds and removes objects."""

from functools import partial

from PyQt5.QtCore import Qt
from PyQt5.QtWidgets import (
    QFileDialog,
    QGridLayout,
    QHeaderView,
    QLineEdit,
    QPushButton,
    QTableWidget,
    QTableWidgetItem,
)

from rpbi_utils.console.remove import remove
from rpbi_utils.console.spawn import spawn
from rpbi_utils.controls.requests import BackgroundRequests, RequestResult

from .link import SimulatorLink, SimulatorSnapshot
from .panel import Panel, named

ADD_LIMIT_S = 120.0
"""Time limit for adding an object [s]. The simulator may have to simplify a mesh first."""


class ObjectsPanel(Panel):
    """Lists the names and types of all objects, adds objects from files, and removes the selected object."""

    def __init__(self, link: SimulatorLink, requests: BackgroundRequests) -> None:
        super().__init__("Objects", link, requests)
        self._table = named(QTableWidget(0, 2), "objects", "Objects in the world")
        self._table.setHorizontalHeaderLabels(["Name", "Type"])
        self._table.verticalHeader().hide()
        self._table.verticalHeader().setDefaultSectionSize(self.fontMetrics().height() + 6)
        self._table.horizontalHeader().setSectionResizeMode(QHeaderView.Stretch)
        self._table.setEditTriggers(QTableWidget.NoEditTriggers)
        self._table.setSelectionBehavior(QTableWidget.SelectRows)
        self._table.setMinimumHeight(90)
        self._file = named(QLineEdit(), "file", "YAML or URDF; {package}/PATH is resolved")
        self._file.setPlaceholderText("YAML or URDF file")
        self._name = named(QLineEdit(), "name", "Another name than in the file")
        self._name.setPlaceholderText("name, if another")
        browse = named(QPushButton("Browse…"), "browse", "Chooses a file")
        browse.clicked.connect(self._browse)
        self._add = named(QPushButton("Add"), "add", "Puts the object of the file into the world")
        self._add.clicked.connect(self._on_add)
        self._file.returnPressed.connect(self._on_add)
        self._remove = named(QPushButton("Remove"), "remove", "Removes the selected object from the world")
        self._remove.clicked.connect(self._on_remove)
        self.require("rpbi/add_pybullet_object", self._add, when=lambda _: bool(self._file.text().strip()))
        self.require("rpbi/remove_pybullet_object", self._remove, when=lambda _: bool(self._chosen()))
        grid = QGridLayout(self)
        grid.addWidget(self._table, 0, 0, 1, 4)
        grid.addWidget(self._file, 1, 0, 1, 3)
        grid.addWidget(browse, 1, 3)
        grid.addWidget(self._name, 2, 0, 1, 2)
        grid.addWidget(self._add, 2, 2)
        grid.addWidget(self._remove, 2, 3)

    def refresh(self, snapshot: SimulatorSnapshot) -> None:
        rows = list(snapshot.objects.items())
        if rows != self._rows():
            chosen = self._chosen()
            self._table.setRowCount(len(rows))
            for row, cells in enumerate(rows):
                for column, text in enumerate(cells):
                    self._table.setItem(row, column, QTableWidgetItem(text))
            self._table.clearSelection()
            for item in (self._table.item(row, 0) for row in range(len(rows))):
                if item.text() in chosen:
                    item.setSelected(True)
                    self._table.item(item.row(), 1).setSelected(True)
        super().refresh(snapshot)

    def _rows(self) -> list[tuple[str, str]]:
        count = self._table.rowCount()
        return [(self._table.item(row, 0).text(), self._table.item(row, 1).text()) for row in range(count)]

    def _chosen(self) -> list[str]:
        return [item.text() for item in self._table.selectedItems() if item.column() == 0]

    def _browse(self) -> None:
        dialog = QFileDialog(self, "Add an object", "", "Objects (*.yaml *.yml *.urdf);;All files (*)")
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.fileSelected.connect(self._file.setText)
        dialog.open()

    def _on_add(self) -> None:
        file, name = self._file.text().strip(), self._name.text().strip()
        if file:
            self.ask("Add", partial(spawn, file, name=name or None), self._look_again, ADD_LIMIT_S)

    def _on_remove(self) -> None:
        self.ask("Remove", partial(remove, *self._chosen()), self._look_again)

    def _look_again(self, _: RequestResult) -> None:
        self.link.look()
