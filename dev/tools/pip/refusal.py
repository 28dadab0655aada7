"""Build backend of `pip install .`, which says how this workspace is installed instead."""

import sys

ADVICE = """
This is a ROS workspace, which pip cannot install: it needs Debian packages and a build of messages.

  ./rpbi setup                  installs and builds all of it in this folder; ./rpbi demo tries it
  .venv/bin/python              finds its packages after that; see docs/python.md
  docs/installation.md          says more
"""


def get_requires_for_build_wheel(config_settings: object = None) -> list[str]:
    """Ends the build with the advice; pip calls it before all else."""
    sys.exit(ADVICE)


get_requires_for_build_editable = get_requires_for_build_sdist = get_requires_for_build_wheel


def build_wheel(wheel_directory: str, config_settings: object = None, metadata_directory: object = None) -> str:
    """Does the same, for programs that skip the requirements."""
    sys.exit(ADVICE)


def build_sdist(sdist_directory: str, config_settings: object = None) -> str:
    """Does the same."""
    sys.exit(ADVICE)


build_editable = build_wheel
