"""The command `view`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NoReturn

from custom_ros_tools.console.argument import Argument, UsageError
from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.files import atomic_file
from custom_ros_tools.plugins import trust_only
from custom_ros_tools.program import late_imports
from rpbi.replay.parallel import TooSlowError, in_limited_fork
from rpbi_data.episodes.errors import EpisodeError
from rpbi_data.episodes.folder import EpisodeFolder

MAX_CPU_S = 600
"""Default limit of the processor time for making a page [s]."""


def view(
    recording: Annotated[Path | None, Argument("DIR|BAG", parse=Path, files="*.bag")] = None,
    number: Annotated[int | None, Argument("N", parse=int)] = None,
    *,
    out: Annotated[Path | None, Argument("FILE.html", parse=Path, files="*.html")] = None,
    ns: Annotated[str | None, Argument("NAMESPACE")] = None,
    host: Annotated[str | None, Argument("HOST")] = None,
    port: Annotated[int | None, Argument("PORT", parse=int)] = None,
    trust: Annotated[Sequence[str], Argument("PACKAGE ...")] = (),
    max_cpu: Annotated[int, Argument("S", parse=int)] = MAX_CPU_S,
    any_size: Annotated[bool, Argument("")] = False,
) -> str:
    """Shows the running world in a browser, or writes an HTML file that shows an episode.

    Without DIR or BAG, prints the link of a page that shows and controls the running simulator, until Ctrl-C. With DIR
    or BAG, writes a page with the world in 3-D, a time line, and forces as arrows and plots; a browser shows the file
    without access to the internet, and no ROS master is needed. Run `./rpbi setup html` first.

        ./rpbi view                                       # the running world
        ./rpbi view demos 0 --out demo.html               # an episode

    Args:
        DIR|BAG: a folder of episodes, or a bag with the topic rpbi/world_description
        N: number of the episode in the folder; not allowed with a bag
        out: the HTML file; default: episode_N.html, or BAG.html for BAG.bag, in the current folder
        ns: namespace of the running or recorded simulator; default: ROS_NAMESPACE, and / for a bag
        host: address to listen at for the running world; 0.0.0.0 serves other computers, too, and prints a link with a
            token; default: 127.0.0.1
        port: port of the page of the running world; default: 8080
        trust: Python packages from which classes named in the recording may be imported, such as object types
        max_cpu: stops after this processor time [s]; default: 600
        any_size: also reads a bag whose unpacked size exceeds both 1 GiB and 255 times its file size
    """
    if recording is None:
        if out is not None or trust or any_size or max_cpu != MAX_CPU_S:
            raise UsageError("--out, --trust, --max-cpu and --any-size need a folder or a bag")
        _show_running(ns, host, port)
    if host is not None or port is not None:
        raise UsageError("--host and --port are for the running world: a page of a recording is a file")
    with late_imports():
        from rpbi_data.view.bag_messages import scene_of_bag, scene_of_episode  # needs an extra
        from rpbi_data.view.page import page_of

    trust_only({"rpbi", *trust}, "--trust PACKAGE, if you know who made the recording")
    is_folder = recording.is_dir()
    if is_folder == (number is None):
        raise UsageError(f"expected a folder and the number of an episode, or a bag, got {recording}")
    if max_cpu < 1:
        raise UsageError(f"--max-cpu: expected at least 1, got {max_cpu}")

    def draw() -> tuple[str, float, list[str]]:
        """Returns the HTML text of the page, the duration that the page shows [s], and notes for the user."""
        try:
            if number is not None:
                scene = scene_of_episode(EpisodeFolder(recording), number, any_size=any_size)
            else:
                scene = scene_of_bag(recording, ns or "/", any_size=any_size)
            page, scene = page_of(scene)
        except InterfaceError:
            raise
        except Exception as error:  # a bag may have anything in it
            raise EpisodeError(recording, f"cannot be shown: {type(error).__name__}: {error}") from error
        return page, float(scene.times[-1]), scene.all_notes

    try:
        page, seconds, notes = in_limited_fork(draw, max_cpu)
    except TooSlowError as error:
        raise EpisodeError(recording, str(error)) from error
    target = out or Path(recording.with_suffix(".html").name if number is None else f"episode_{number}.html")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(target) as part:
            part.write_text(page, encoding="utf-8")
    except OSError as error:
        raise EpisodeError(target, f"cannot be written: {error.strerror or error}") from error
    lines = [f"note: {note}" for note in notes]
    return "\n".join([f"{target}: {seconds:.1f} s, {target.stat().st_size / 1e6:.2f} MB", *lines])


def _show_running(ns: str | None, host: str | None, port: int | None) -> NoReturn:
    """Replaces this process by the node that shows the running world."""
    words = ["rosrun", "rpbi_data", "browser_view_node.py", f"__name:=view_{os.getpid()}"]
    words += [] if ns is None else [f"__ns:=/{ns.strip('/')}"]
    words += [] if host is None else [f"_host:={host}"]
    words += [] if port is None else [f"_port:={port}"]
    os.execvp("rosrun", words)
