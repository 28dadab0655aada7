"""Gymnasium environments with the robots of the examples; importing this module registers them."""

from rpbi.gym.env import register
from rpbi.gym.tasks import TASKS
from rpbi_examples.scenes import SCENES

FOLDER = "{rpbi_examples}/configs/gym"
ENVIRONMENTS = {f"rpbi/{name.capitalize()}-v0": name for name in TASKS}
"""Folder of each environment's files, indexed by the environment's id."""

SCENE_ENVIRONMENTS = {f"rpbi/{''.join(map(str.capitalize, name.split('_')))}-v0": name for name in SCENES}
"""Scenes that are also environments, indexed by the environment's id; see docs/examples.md."""

for _id, _folder in ENVIRONMENTS.items():
    register(_id, f"{FOLDER}/{_folder}/world.yaml", f"{FOLDER}/{_folder}/task.yaml")
for _id, _scene in SCENE_ENVIRONMENTS.items():
    _task = {"type": "rpbi_examples.scenes.task:SceneTask", "scene": _scene, "action_ticks": 20, "max_actions": 1500}
    register(_id, f"{{rpbi_examples}}/configs/{_scene}/config.yaml", _task)
