"""Gymnasium environments with the robots of the examples. Importing this module registers the environments."""

from rpbi.gym.env import register
from rpbi.gym.tasks import TASKS
from rpbi_examples.scenes import SCENES

FOLDER = "{rpbi_examples}/configs/gym"
ENVIRONMENTS = {f"rpbi/{name.capitalize()}-v0": name for name in TASKS}
"""Name of each environment's folder below `FOLDER`, indexed by the environment's id."""

SCENE_ENVIRONMENTS = {f"rpbi/{''.join(map(str.capitalize, name.split('_')))}-v0": name for name in SCENES}
"""Names of the scenes that are registered as environments, indexed by the environment's id; see docs/scenes.md."""

for _id, _folder in ENVIRONMENTS.items():
    register(_id, f"{FOLDER}/{_folder}/world.yaml", f"{FOLDER}/{_folder}/task.yaml")
for _id, _scene in SCENE_ENVIRONMENTS.items():
    _task = {"type": "rpbi_examples.scenes.task:SceneTask", "scene": _scene, "action_ticks": 20}
    register(_id, f"{{rpbi_examples}}/configs/{_scene}/config.yaml", _task)
