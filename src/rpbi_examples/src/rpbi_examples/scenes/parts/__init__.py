"""Parts of scenes that other scenes can use: arms, paths, people, grasps, a belt."""
