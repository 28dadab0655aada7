"""Parts of scenes that others can use: arms, paths, people, grasps."""
