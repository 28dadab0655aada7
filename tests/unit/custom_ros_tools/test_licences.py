"""`./rpbi licences`: names of licences from the files of each part."""

from __future__ import annotations

import pytest

from custom_ros_tools.console.licences import debian_packages, first_line, licences, models, python_packages, shown


def test_list_has_packages_models_and_requirements():
    listed = licences()
    sections = {text.partition("\n")[0]: text for text in listed.split("\n\n")}
    own = next(text for title, text in sections.items() if title.startswith("Packages of this workspace"))
    assert own.count("LGPL-3.0-or-later") == own.count("\n") > 20
    assert "zlib" in next(line for line in sections["Python packages (base)"].splitlines() if "pybullet " in line)
    assert "pybullet_data/franka_panda" in listed and "LICENSE.txt: Apache License" in listed
    assert any(title.endswith("(extra mpc)") for title in sections)


def test_python_packages_without_metadata_are_named(tmp_path):
    file = tmp_path / "some.txt"
    file.write_text("# numpy==9 in a comment\nnumpy<2\n    no-such-package==1.0  # why\n")
    (numpy, missing) = python_packages(file)
    assert numpy[0] == "numpy" and "BSD" in numpy[2]
    assert missing == ("no-such-package", "not installed", "")


DEBIAN = {
    "format": (
        "Format: https://x\n\nFiles: *\nLicense: BSD-3-clause\nLicense: GPL-2+\nLicense: BSD-3-clause\n",
        "BSD-3-clause, GPL-2+",
    ),
    "text": ("This package\nLicense: x\n", "see "),
    "empty": ("Format: https://x\n", "see "),
}
"""Content of a copyright file, and how it is listed."""


@pytest.mark.parametrize("case", DEBIAN)
def test_copyright_files_of_debian(tmp_path, case):
    content, expected = DEBIAN[case]
    (tmp_path / "docs/some").mkdir(parents=True)
    (tmp_path / "docs/some/copyright").write_text(content)
    (tmp_path / "list.txt").write_text("some other # a comment\n")
    other, some = debian_packages(tmp_path / "list.txt", tmp_path / "docs")
    assert other == ("other", "not installed", "")
    assert some[2].startswith(expected)


def test_models_without_a_licence_file_are_counted(tmp_path):
    for name in ("arm", "bike", "cup"):
        (tmp_path / name).mkdir()
    (tmp_path / "bike/License.txt").write_text("\n# ---\n# Zlib\n")
    rows = [(name, licence) for name, _, licence in models("data", tmp_path)]
    assert rows == [("data/bike", "License.txt: Zlib"), ("data/*", "2 more folders without a licence file")]


def test_text_without_letters_is_not_stated(tmp_path):
    (tmp_path / "LICENSE").write_text("----\n")
    assert first_line(tmp_path / "LICENSE") == "not stated"


def test_long_lists_are_cut():
    assert shown("abcdefga") == "a, b, c, d, e and 2 more"
