"""Environments of Gymnasium with the robots of the examples; importing this registers their names."""

from rpbi.gym.env import register

FOLDER = "{rpbi_examples}/configs/gym"
ENVIRONMENTS = {f"rpbi/{name.capitalize()}-v0": name for name in ("reach", "push", "lift", "wipe", "peg")}
"""Folder of each environment's files by its id."""

for _id, _folder in ENVIRONMENTS.items():
    register(_id, f"{FOLDER}/{_folder}/world.yaml", f"{FOLDER}/{_folder}/task.yaml")
