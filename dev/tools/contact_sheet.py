"""Draws the contact sheet of docs/examples.md: the robots, and the scenes at work; and a picture of each scene.

python3 dev/tools/contact_sheet.py      # in ./rpbi shell, with the extras gym, ik and assets
"""

import sys
from itertools import count
from pathlib import Path

import numpy as np
import pybullet
from PIL import Image, ImageDraw, ImageFont

from rpbi.images import CameraImages, looking_at
from rpbi.world import World
from rpbi_examples.scenes.scene import run_scene
from rpbi_examples.scenes.task import EnvStage, make_env

IMAGES = Path(__file__).parents[2] / "docs/images"
SIZE_PX, COLUMNS, CAPTION_PX = (320, 240), 4, 22
SEED = 3
SCENES = {"cup": 6.0, "wiping": 8.0, "handover": 8.0, "talos": 3.96, "factory": 16.0, "dual_arm": 5.0}
"""Scenes, and when they are drawn [s]."""
ROBOTS = {
    "kuka_lwr": ((1.6, -1.5, 1.3), (0.45, 0.0, 0.45)),
    "dual_iiwa": ((2.0, -1.2, 1.5), (0.2, 0.0, 0.7)),
    "panda": ((1.3, -1.2, 1.0), (0.25, 0.0, 0.4)),
    "kinova": ((1.1, -1.1, 0.9), (0.0, 0.0, 0.4)),
    "talos": ((2.4, -1.6, 1.7), (0.0, 0.0, 1.0)),
    "nextage": ((1.7, -1.1, 1.7), (0.0, 0.0, 1.0)),
    "mobile_base": ((0.3, -1.9, 1.2), (-0.9, 0.0, 0.2)),
    "human_model": ((2.6, -1.6, 1.6), (0.0, 0.0, 0.95)),
}
"""Robots of the basic examples: where the camera is and where it looks [m]."""
STANDING_TICKS, SETTLED_TICKS = 100, 3000


def scene(name: str) -> Image.Image:
    """Returns images of a scene's camera while the scene acts."""
    env = make_env(name, "rgb_array")
    env.task.seed = SEED
    env.reset(seed=SEED)
    env.task.scene.longest_s = SCENES[name]
    run_scene(env.task.scene, EnvStage(env))
    image = Image.fromarray(env.render())
    env.close()
    return image


def built(name: str) -> World:
    """Returns the world of an example."""
    return World.from_file(f"{{rpbi_examples}}/configs/{name}/config.yaml", connection_mode=pybullet.DIRECT)


def robot(name: str) -> Image.Image:
    """Returns a picture of a robot of a basic example."""
    world = World.from_file(
        f"{{rpbi_examples}}/configs/basic_example_{name}/config.yaml", connection_mode=pybullet.DIRECT
    )
    position, target = ROBOTS[name]
    intrinsics = {"width": 640, "height": 480, "fov": 40, "range": [0.1, 20.0]}
    world.add_camera({"name": "sheet", "hz": 1, "intrinsics": intrinsics, "object_tf": {"tf_id": "sheet"}})
    world.put("sheet/pose", looking_at(position, target))
    for _ in range(STANDING_TICKS):
        world.step()
    images = CameraImages(world)
    image = Image.fromarray(images.frame("sheet").colour)
    images.close()
    world.close()
    return image


def settled(name: str) -> Image.Image:
    """Returns an image of a world's camera after its objects have come to rest."""
    world = built(name)
    for _ in range(SETTLED_TICKS):
        world.step()
    images = CameraImages(world)
    image = Image.fromarray(images.frame().colour)
    images.close()
    world.close()
    return image


def main() -> None:
    """Writes the sheet, and a picture of each scene."""
    pictures = {f"basic_example_{name}": robot(name) for name in ROBOTS}
    for name in SCENES:
        pictures[name] = scene(name)
        pictures[name].quantize(128).save(IMAGES / f"scene_{name}.png", optimize=True)
    pictures["clutter"] = settled("clutter")
    width, height = SIZE_PX
    rows = -(-len(pictures) // COLUMNS)
    sheet = Image.new("RGB", (width * COLUMNS, (height + CAPTION_PX) * rows), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default()
    for index, (name, picture) in zip(count(), pictures.items()):
        left, top = index % COLUMNS * width, index // COLUMNS * (height + CAPTION_PX)
        sheet.paste(picture.resize(SIZE_PX, Image.Resampling.LANCZOS), (left, top))
        draw.text((left + 8, top + height + 5), name, "black", font)
    sheet.quantize(128).save(IMAGES / "examples.png", optimize=True)
    print(f"written: {IMAGES / 'examples.png'}, {np.asarray(sheet).shape}")


if __name__ == "__main__":
    sys.exit(main())
