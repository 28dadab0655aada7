"""The command `reality`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from custom_ros_tools.console.argument import Argument, UsageError
from custom_ros_tools.errors import InterfaceError
from rpbi_reality.evaluation import PushResult, TossResult, evaluate_pushes, evaluate_tosses, find_file, find_urdf
from rpbi_reality.page import write_page
from rpbi_reality.pictures import write_pictures
from rpbi_reality.pushes.convert_pushes import RECORDINGS, convert_pushes
from rpbi_reality.report import push_table, toss_table, write_json
from rpbi_reality.tosses.convert_tosses import convert_tosses


def reality(
    *,
    data: Annotated[Path, Argument("DIR", parse=Path, files="*")] = Path("out/real_contacts"),
    urdf: Annotated[Path | None, Argument("FILE", parse=Path, files="*.urdf")] = None,
    out: Annotated[Path, Argument("FOLDER", parse=Path, files="*")] = Path("out/reality"),
    json: Annotated[Path | None, Argument("FILE", parse=Path, files="*.json")] = None,
    no_pictures: Annotated[bool, Argument("")] = False,
    convert: Annotated[Path | None, Argument("REPOSITORY", parse=Path, files="*")] = None,
) -> int:
    """Simulates published experiments with real contacts, and prints how far the simulation is from the measurements.

    The experiments are tosses of a cube, and an arm that reaches for and pushes a cube. docs/reality.md says what to
    download, and shows the tables. The tables are also written as JSON, with pictures and a page in which measured and
    simulated bodies move. An experiment without data is left out. The exit code is 1 if an experiment cannot be
    evaluated.

    Args:
        data: folder with cube_tosses.npz, arm_pushes.npz, arm_pushes_simulators.npz and m1n6s300/m1n6s300.urdf;
            default out/real_contacts
        urdf: URDF of the arm, if it is in another folder
        out: folder for pictures and page; default out/reality
        json: file for the tables; default FOLDER/reality.json
        no_pictures: writes neither pictures nor page
        convert: a clone of the repository with the published tosses or pushes; writes cube_tosses.npz, or
            arm_pushes.npz and arm_pushes_simulators.npz, to the folder of the data, and ends
    """
    if convert is not None:
        if (convert / RECORDINGS).is_dir():
            for path, count in convert_pushes(convert, data).items():
                print(f"{path}: {count} runs")
        else:
            count = convert_tosses(convert, data / "cube_tosses.npz")
            print(f"{data / 'cube_tosses.npz'}: {count} tosses")
        return 0
    if not data.is_dir():
        raise UsageError(f"--data: there is no folder {data}; docs/reality.md says what to download")
    problems: list[str] = []
    tosses: TossResult | None = None
    pushes: list[PushResult] = []
    try:
        if (file := find_file(data, "cube_tosses")) is not None:
            tosses = evaluate_tosses(file)
            print(f"{toss_table(tosses)}\n", flush=True)
    except InterfaceError as error:
        problems.append(str(error))
    try:
        if (file := find_file(data, "arm_pushes")) is not None:
            arm = urdf or find_urdf(data)
            if arm is None:
                problems.append(f"{data}: m1n6s300/m1n6s300.urdf is missing, so the arm is not simulated")
            simulators = data / "arm_pushes_simulators.npz"
            for each in evaluate_pushes(file, arm, simulators if simulators.is_file() else None):
                pushes.append(each)
                print(f"{push_table(each)}\n", flush=True)
    except InterfaceError as error:
        problems.append(str(error))
    if tosses is None and not pushes and not problems:
        problems.append(f"{data}: expected cube_tosses.npz or arm_pushes.npz")
    results = json or out / "reality.json"
    write_json(results, tosses, pushes, problems)
    print(results)
    if not no_pictures and (tosses is not None or pushes):
        print(*map(str, write_pictures(out, tosses, pushes)), sep="\n")
        write_page(out / "reality.html", tosses, pushes)
        print(out / "reality.html")
    for problem in problems:
        print(problem, file=sys.stderr)
    return int(bool(problems))
