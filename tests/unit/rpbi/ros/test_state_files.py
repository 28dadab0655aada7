"""Files that callers of `rpbi/save` and `rpbi/restore` may name."""

from __future__ import annotations

import pytest

from custom_ros_tools.errors import InterfaceError
from rpbi.ros.services.states import state_file


def test_states_are_files_below_the_folder(tmp_path):
    (tmp_path / "real").mkdir()
    folder = tmp_path / "home"
    folder.symlink_to(tmp_path / "real")
    expected = folder / "a/b.world"
    for name in ("a/b.world", str(expected), str(tmp_path / "real/a/b.world")):
        assert state_file(folder, name) == expected


@pytest.mark.parametrize(
    "name", ["/etc/x.world", "../x.world", "{folder}/../x.world", "link/x.world", "{folder}/link.world", "", "a.yaml"]
)
def test_other_names_are_refused(tmp_path, name):
    (tmp_path / "link").symlink_to("/etc")
    (tmp_path / "link.world").symlink_to("/etc/passwd")
    with pytest.raises(InterfaceError, match="expected"):
        state_file(tmp_path, name.format(folder=tmp_path))
