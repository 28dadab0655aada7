"""Completes hostile launch files and answers of rogue nodes in bash, and prints a table of the outcomes.

Run it by `./rpbi shell -c 'python3 dev/robustness/completion.py'`; it exits with 1 if code ran, a program printed a
traceback, or a completion took more than 60 s or 2 GB. The table in docs/security_tests.md is its.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "dev"), *map(str, (ROOT / "tests/support").iterdir())]

from terminal import Terminal  # noqa: E402

LONGEST_S, MOST_MB = 60.0, 2000.0
CANARY = "canary"
"""File that the code of each text below makes in the folder of the terminal."""
UNGUARDED = '_rpbi_plain() { cat; }; _rpbi_starting_with() { compgen -W "$(cat)" -- "$1"; }\n'
"""Lines for bash by which completion expands words again, as a control."""
TEXTS = (
    *("$(>canary)", "`>canary`", "${x:=$(>canary)}", "$((x[$(>canary)]))", "<(>canary)", ";>canary;", "|tee>canary"),
    *("'$(>canary)'", "$'\\x24(>canary)'", "x\n>canary\n", "x\r>canary\r", "$(touch${IFS}canary)", "\\$(>canary)"),
    *("\x1b]0;x\x07", "\x16\x03", "\x9b31m", "\u202e$(>canary)", "\ud7ff", "\t", "--help", "-n", "~root", "*", "{a,b}"),
    *("!!", "'", "\\", "", " ", "x" * 100_000, "x/../../y", "&lt;", "speed", "x y", "1e >canary", "$IFS"),
)


def text(random: Random) -> str:
    """Returns a hostile name."""
    return random.choice(("", "", "speed", "x_")) + random.choice(TEXTS) + random.choice(("", "", "`>canary`"))


def make_launch(seed: int, folder: Path) -> str:
    """Makes a file or another entry in a folder, and returns a line that completes arguments of a launch."""
    random = Random(seed)
    path = folder / f"h{seed}.launch"
    names = [text(random) for _ in range(random.choice((1, 3, 30)))]
    lines = [f'  <arg name="{name}" default="{text(random)}"/>' for name in names]
    kind = random.randrange(12)
    if kind == 0:
        lines *= max(20_000_000 // sum(map(len, lines)), 1)
    elif kind == 1:
        lines.insert(0, " " * 30_000_000)
    elif kind == 2:
        bomb = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 10))
        lines.insert(0, f'<!DOCTYPE launch [<!ENTITY e0 "x">{bomb}]><launch>&e9;</launch>')
    elif kind == 3:
        odd = random.choice(("/dev/zero", "$(find x)/$(eval 1)", "../" * 200, "/proc/self/mem", f"h{seed}.launch"))
        lines.insert(0, f'<include file="{odd}" pass_all_args="true"/>')
    elif kind == 4:
        os.mkfifo(path)
        return f"./rpbi launch h{seed}.launch \t"
    elif kind == 5:
        path.symlink_to(random.choice(("/dev/zero", "/proc/kmsg", str(path), "/nowhere")))
        return f"./rpbi launch h{seed}.launch \t"
    elif kind == 6:
        path.mkdir()
    elif kind == 7:
        name = text(random).replace("/", "").replace("\0", "")[:200]
        (folder / f"h{seed}{name}.launch").touch()
        return f"./rpbi launch h{seed}\t \t"
    if not path.exists():
        ending = bytes(random.randrange(256) for _ in range(200)) if kind == 8 else b"</launch>\n"
        path.write_bytes("<launch>\n{}\n".format("\n".join(lines)).encode() + ending)
    return f"./rpbi launch h{seed}.launch {random.choice(('', '', 'sp', 'x'))}\t"


def rogue_names(seed: int) -> list[str]:
    """Returns names of objects that a rogue node lists."""
    random = Random(seed)
    names = [text(random) for _ in range(random.choice((1, 3, 30)))]
    most = 100_000 if max(map(len, names)) < 1000 else 500
    return names * (most // len(names)) if random.random() < 0.05 else names


def trial(terminal: Terminal, folder: Path, line: str) -> tuple[str, float]:
    """Types a line that ends with a tab, and echoes the result; returns the verdict and the time [s]."""
    (folder / CANARY).unlink(missing_ok=True)
    began_s = time.monotonic()
    try:
        seen = terminal.shown(line)
    except AssertionError:
        return "hang", time.monotonic() - began_s
    taken_s = time.monotonic() - began_s
    if (folder / CANARY).exists():
        return "code", taken_s
    if "Traceback" in seen or "error" in seen:
        return "traceback", taken_s
    return "hang" if taken_s > LONGEST_S else "fine", taken_s


def _row(kind: str, lines: Iterator[str], folder: Path, **environment: str) -> bool:
    """Completes lines in a new terminal and prints a row of the table; returns whether all were fine."""
    terminal = Terminal(folder, **environment)
    found = []
    for number, line in enumerate(lines):
        found.append(trial(terminal, folder, line))
        if found[-1][0] != "fine":
            print(f"{kind} {number}: {found[-1]}: {line!r}", flush=True)
        if found[-1][0] == "hang":
            break
    terminal.close()
    verdicts = [verdict for verdict, _ in found]
    longest_s = max(taken_s for _, taken_s in found)
    largest_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e3
    counts = (verdicts.count(each) for each in ("code", "traceback", "hang"))
    cells = kind, len(found), *counts, f"{longest_s:.1f}", f"{largest_mb:.0f}"
    print(f"| {' | '.join(map(str, cells))} |", flush=True)
    return all(verdict == "fine" for verdict in verdicts) and largest_mb <= MOST_MB


def _answers(seeds: range, answer: Callable[[list[str]], None]) -> Iterator[str]:
    for seed in seeds:
        answer(rogue_names(seed))
        yield f"./rpbi {Random(seed).choice(('remove', 'move', 'attach', 'detach'))} {Random(seed).choice(('', 's'))}\t"


def main() -> None:
    """Tries the files, then the answers."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=200, help="of launch files and of answers; default: %(default)s")
    parser.add_argument("--first", type=int, default=0, help="the first seed; default: %(default)s")
    arguments = parser.parse_args()
    seeds = range(arguments.first, arguments.first + arguments.count)
    print("| completion of | number | code | tracebacks | hangs | longest [s] | most memory [MB] |")
    print("|---" * 7 + "|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        is_fine = _row("launch files", (make_launch(seed, folder) for seed in seeds), folder)

    import rospy

    from ros_pybullet_interface.srv import ListObjects, ListObjectsResponse

    names: list[str] = []
    port = 20_000 + os.getpid() % 10_000
    os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
    with tempfile.TemporaryDirectory() as name, subprocess.Popen(["rosmaster", "--core", "-p", str(port)]) as master:
        rospy.init_node("rogue", disable_rostime=True, disable_signals=True)
        rospy.Service("rpbi/list_objects", ListObjects, lambda _: ListObjectsResponse(names, names))

        def answer(of_seed: list[str]) -> None:
            names[:] = of_seed

        kept = {key: os.environ[key] for key in ("ROS_MASTER_URI", "ROS_IP") if key in os.environ}
        is_fine &= _row("answers", _answers(seeds, answer), Path(name), ROS_HOME=name, **kept)
        rospy.signal_shutdown("done")
        master.terminate()
    sys.exit(not is_fine)


if __name__ == "__main__":
    main()
