"""Diagrams of the packages, a tick, an episode that becomes a data set, two computers, and the bridge to ROS 2."""

from __future__ import annotations

from pathlib import Path

from svg import DATA, GUARD, LINE_PX, PEOPLE, PLAIN, SIMULATOR, Box, Diagram

STEPS = (
    ("1  serve requests", "start, stop, add, move, ..."),
    ("2  apply the newest inputs", "joint targets, poses, pushes"),
    ("3  bodies act", "motions, controllers, motors"),
    ("4  step PyBullet", "tick number + 1"),
    ("5  read the sensors that are due", "all after the same step"),
    ("6  publish /clock, then the samples", "all with the stamp of this tick"),
    ("7  sleep until the next tick is due", "late ticks are caught up with"),
)
"""Steps of a tick, as in docs/concepts.md."""
RECORD = ("$./rpbi farm", "a policy, many episodes", "$record.launch", "a person or a running robot")
EPISODE = (
    "episode.bag: messages,",
    "commands, state hashes",
    "files/: world, URDFs, meshes",
    "episode.yaml: seals, versions",
)
VERIFY = ("$./rpbi verify", "same to the last bit, or", "tick, topic and field of", "the first difference")
DATASET = (
    "LeRobot, robomimic",
    "or rosbag2 (MCAP)",
    "rpbi/: SHA-256 of the bag,",
    "chain of state hashes,",
    "checksums of all columns",
)
TRAIN = ("with LeRobot, robomimic", "or code of your own")
CHECK = (
    "$./rpbi check_dataset",
    "names rows that are lost,",
    "shifted, swapped or",
    "changed, and videos with",
    "wrong frames",
)


def architecture(path: Path) -> None:
    """Draws the packages and the data that flow between them."""
    drawing = Diagram(800, 706, "Packages, and the data that flow between them")
    people = drawing.box(Box(20, 20, 240, 62), PEOPLE, "operator_node", ["people: devices, suits, haptics"])
    planned = drawing.box(Box(280, 20, 240, 62), PEOPLE, "rpbi_planning, rpbi_mpc", ["and motion_primitives"])
    own = drawing.box(Box(540, 20, 226, 62), PLAIN, "your node or policy", ["ROS topics, or Python alone"])
    solver = drawing.box(
        Box(20, 132, 420, 58), PLAIN, "ik_ros", ["inverse kinematics: pose of a hand to joint targets"]
    )
    guard = drawing.box(
        Box(20, 240, 560, 58),
        GUARD,
        "safe_robot: the guard",
        ["checks limits and collisions of every target; optional in simulation"],
    )
    world = drawing.box(Box(20, 348, 560, 140), SIMULATOR, "ros_pybullet_interface: the simulator", centred=False)
    drawing.box(
        Box(36, 386, 200, 86), "white", "World", ["PyBullet, tick by tick,", "at 1 kHz; each input", "is logged"]
    )
    drawing.box(Box(252, 386, 150, 86), "white", "camera process", ["colour, depth,", "point clouds"])
    drawing.box(Box(418, 386, 146, 86), "white", "forks", ["copies that show", "what will happen"])
    robot = drawing.box(Box(626, 348, 140, 58), PLAIN, "real robot", ["its driver"])
    data = drawing.box(
        Box(20, 538, 370, 58), DATA, "rpbi_data, rpbi_reality", ["recordings, data sets; measured contacts"]
    )
    tools = drawing.box(Box(410, 538, 356, 58), PLAIN, "rpbi_utils, RViz", ["controls window, live plots, tracking"])
    drawing.arrow(people.bottom(), (people.bottom()[0], solver.y))
    drawing.arrow(planned.bottom(0.25), (planned.bottom(0.25)[0], solver.y))
    drawing.text((240, 113), "poses of a hand")
    drawing.arrow(planned.bottom(0.8), (planned.bottom(0.8)[0], guard.y))
    drawing.arrow(own.bottom(0.1), (own.bottom(0.1)[0], guard.y))
    drawing.arrow(solver.bottom(), (solver.bottom()[0], guard.y))
    drawing.text((395, 221), "joint targets")
    drawing.arrow(guard.bottom(), (guard.bottom()[0], world.y))
    drawing.text((308, 328), "safe targets", anchor="start")
    drawing.arrow(guard.right(), (robot.top()[0], guard.right()[1]), robot.top())
    drawing.text((688, 328), "safe targets", anchor="end")
    drawing.arrow(world.right(0.85), (784, world.right(0.85)[1]), (784, own.right()[1]), own.right())
    drawing.arrow(robot.right(), (784, robot.right()[1]))
    for number, line in enumerate(("measured:", "joint states,", "contacts, forces,", "TF, images")):
        drawing.text((776, 130 + LINE_PX * number), line, anchor="end")
    drawing.arrow(world.bottom(0.12), (world.bottom(0.12)[0], data.y))
    drawing.text((92, 518), "commands, hashes, messages", anchor="start")
    drawing.arrow((330, data.y), (330, 488))
    drawing.text((338, 518), "run again", anchor="start")
    drawing.arrow((490, 488), (490, tools.y))
    drawing.text((498, 518), "topics, services", anchor="start")
    drawing.text((20, 616), "examples and common libraries", anchor="start")
    drawing.box(Box(20, 628, 240, 58), PLAIN, "rpbi_examples", ["worlds, robots, scenes"])
    drawing.box(Box(280, 628, 236, 58), PLAIN, "robot_model", ["URDFs, limits, distances"])
    drawing.box(Box(536, 628, 230, 58), PLAIN, "custom_ros_tools", ["YAML, plug-ins, nodes"])
    drawing.write(path)


def tick(path: Path) -> None:
    """Draws the steps of a tick, and the threads and processes that exchange data with it."""
    drawing = Diagram(800, 464, "One tick of the simulator")
    drawing.box(Box(236, 16, 328, 432), SIMULATOR, "a tick: the thread that owns PyBullet", centred=False)
    rows = [Box(252, 48 + 56 * number, 296, 48) for number in range(len(STEPS))]
    for row, (title, line) in zip(rows, STEPS):
        drawing.box(row, "white", title, [line])
    service = drawing.box(Box(16, 44, 140, 56), PEOPLE, "services", ["requests"])
    topics = drawing.box(Box(16, 108, 140, 56), PEOPLE, "subscribers", ["the newest value"])
    log = drawing.box(Box(16, 226, 140, 82), DATA, "command log", ["each change,", "with its tick"])
    drawing.arrow(service.right(), rows[0].left(), both=True)
    drawing.arrow((topics.right()[0], rows[1].left(0.5)[1]), rows[1].left(0.5))
    drawing.arrow(rows[1].left(0.85), (200, rows[1].left(0.85)[1]), (200, 267), log.right())
    drawing.arrow(log.bottom(), (log.bottom()[0], 340))
    for number, line in enumerate(("replay, save,", "fork, predict")):
        drawing.text((86, 360 + LINE_PX * number), line)
    nodes = drawing.box(Box(644, 321, 140, 62), PEOPLE, "other nodes", ["topics"])
    camera = drawing.box(Box(644, 226, 140, 62), SIMULATOR, "camera process", ["draws the images"])
    drawing.arrow(rows[5].right(), nodes.left())
    drawing.arrow(rows[5].right(0.2), (600, rows[5].right(0.2)[1]), (600, 257), camera.left())
    drawing.arrow(camera.bottom(), nodes.top())
    drawing.arrow(rows[6].right(), (620, rows[6].right()[1]), (620, rows[0].right()[1]), rows[0].right(), dashed=True)
    drawing.text((630, 76), "next tick", anchor="start")
    drawing.write(path)


def episode_to_dataset(path: Path) -> None:
    """Draws how an episode is recorded, simulated again, exported and checked."""
    drawing = Diagram(800, 366, "From an episode to a verified data set")
    record = drawing.box(Box(16, 20, 210, 114), PEOPLE, "record", RECORD, centred=False)
    episode = drawing.box(Box(284, 20, 234, 114), DATA, "episode", EPISODE, centred=False)
    verify = drawing.box(Box(576, 20, 208, 114), GUARD, "simulate again", VERIFY, centred=False)
    train = drawing.box(Box(16, 246, 210, 74), PLAIN, "train", TRAIN, centred=False)
    dataset = drawing.box(Box(284, 216, 234, 134), DATA, "data set", DATASET, centred=False)
    check = drawing.box(Box(576, 216, 208, 134), GUARD, "check", CHECK, centred=False)
    drawing.arrow(record.right(), episode.left())
    drawing.arrow(episode.right(), verify.left())
    drawing.arrow(episode.bottom(), dataset.top())
    drawing.text((410, 172), "./rpbi export", "code", "start")
    drawing.text((410, 192), "rows of one rate", anchor="start")
    drawing.arrow(dataset.right(), check.left())
    drawing.arrow(dataset.left(), train.right())
    drawing.write(path)


def computers(path: Path) -> None:
    """Draws the connections of nodes on two computers: each to the master, and directly to each other."""
    drawing = Diagram(800, 300, "Nodes on two computers: each needs the master and the other nodes")
    drawing.box(Box(16, 16, 330, 268), PLAIN, "robot PC, 192.168.1.10", centred=False)
    drawing.box(Box(454, 16, 330, 268), PLAIN, "your computer, 192.168.1.20", centred=False)
    master = drawing.box(Box(36, 60, 290, 62), DATA, "roscore: the master", ["TCP port 11311"])
    driver = drawing.box(
        Box(36, 180, 290, 84), PEOPLE, "driver, sensors", ["publish measured states,", "read commands"]
    )
    nodes = drawing.box(Box(474, 60, 290, 62), GUARD, "guard, RViz, your nodes", ["two TCP ports for each node"])
    world = drawing.box(
        Box(474, 180, 290, 84), SIMULATOR, "simulator", ["publishes simulated states,", "reads targets"]
    )
    drawing.arrow(nodes.left(), master.right(), dashed=True)
    drawing.text((400, 62), "names,")
    drawing.text((400, 80), "addresses")
    drawing.arrow(driver.top(), master.bottom(), dashed=True)
    drawing.arrow(nodes.left(0.8), driver.right(0.2), both=True)
    drawing.arrow(driver.right(0.6), world.left(0.6), both=True)
    drawing.text((400, 250), "messages")
    drawing.arrow(world.top(), nodes.bottom(), both=True)
    drawing.write(path)


def ros2(path: Path) -> None:
    """Draws the bridge between the topics of ROS 1 and programs with ROS 2, and the companion for services."""
    drawing = Diagram(800, 250, "Topics pass through the bridge; services and actions need the companion")
    drawing.box(Box(16, 16, 420, 218), PLAIN, "the simulator's computer, with ROS 1", centred=False)
    drawing.box(Box(534, 16, 250, 218), PLAIN, "programs with ROS 2", centred=False)
    world = drawing.box(Box(32, 60, 170, 158), SIMULATOR, "simulator, nodes", ["topics of ROS 1,", "services"])
    bridge = drawing.box(Box(250, 60, 170, 158), GUARD, "the bridge", ["rpbi_ros2,", "Cyclone DDS"])
    nodes = drawing.box(Box(550, 60, 218, 66), PEOPLE, "your programs", ["tested: rclpy, Fast DDS"])
    companion = drawing.box(
        Box(550, 144, 218, 74), PEOPLE, "the companion", ["services and actions", "of the simulator"]
    )
    drawing.arrow(world.right(), bridge.left(), both=True)
    for other in (nodes, companion):
        drawing.arrow((bridge.right()[0], other.left()[1]), other.left(), both=True)
    drawing.text((477, 78), "topics")
    drawing.text((477, 164), "requests")
    drawing.write(path)
