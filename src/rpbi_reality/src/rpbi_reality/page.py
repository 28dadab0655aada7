"""An HTML page in which measured and simulated bodies move."""

from __future__ import annotations

import html
import json
from pathlib import Path
from typing import Any

import numpy as np

from custom_ros_tools.files import atomic_file

from .evaluation import PushResult, TossResult
from .pictures import chosen_tosses
from .pushes.push_data import STEP_S, PushPoses, mean_poses

_HEAD = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Measured and simulated motion</title>
<style>
body { font-family: sans-serif; margin: 1em auto; max-width: 900px; color: #222; }
canvas { width: 100%; background: #fafafa; border: 1px solid #ddd; touch-action: none; }
.bar { display: flex; gap: 1em; align-items: center; } .bar input { flex: 1; }
.real { color: #444; font-weight: bold; } .simulated { color: #e67e00; font-weight: bold; }
</style></head><body>
<h1>Measured and simulated motion</h1>
<p><span class="real">grey: measured</span>, <span class="simulated">orange: simulated</span>. Drag a picture to turn
it.</p>
"""
_SCRIPT = """
function turn(q, v) {
  const [x, y, z, w] = q, [a, b, c] = v;
  const s = [y * c - z * b + w * a, z * a - x * c + w * b, x * b - y * a + w * c];
  return [a + 2 * (y * s[2] - z * s[1]), b + 2 * (z * s[0] - x * s[2]), c + 2 * (x * s[1] - y * s[0])];
}
const corners = [], edges = [];
for (let i = 0; i < 8; i++) corners.push([i & 1 ? .5 : -.5, i & 2 ? .5 : -.5, i & 4 ? .5 : -.5]);
for (let i = 0; i < 8; i++) for (const bit of [1, 2, 4]) if (!(i & bit)) edges.push([i, i | bit]);
for (const scene of scenes) {
  const section = document.getElementById(scene.id), canvas = section.querySelector("canvas");
  const slider = section.querySelector("input"), button = section.querySelector("button");
  const label = section.querySelector("output"), draw2d = canvas.getContext("2d");
  canvas.width = 1200; canvas.height = 620;
  let yaw = scene.yaw, pitch = 0.25, playing = false, begun = 0;
  slider.max = scene.frames - 1; slider.value = 0;
  function place(p) {
    const d = [p[0] - scene.centre[0], p[1] - scene.centre[1], p[2] - scene.centre[2]];
    const x = Math.cos(yaw) * d[0] + Math.sin(yaw) * d[1], depth = -Math.sin(yaw) * d[0] + Math.cos(yaw) * d[1];
    return [600 + x * scene.scale, 330 - (d[2] * Math.cos(pitch) + depth * Math.sin(pitch)) * scene.scale];
  }
  function line(a, b, colour, width) {
    draw2d.strokeStyle = colour; draw2d.lineWidth = width;
    draw2d.beginPath(); draw2d.moveTo(...place(a)); draw2d.lineTo(...place(b)); draw2d.stroke();
  }
  function show() {
    const frame = +slider.value;
    draw2d.clearRect(0, 0, canvas.width, canvas.height);
    for (let i = -5; i <= 5; i++) for (const swap of [0, 1]) {
      const a = [i * .1, -.5], b = [i * .1, .5];
      const [p, q] = swap ? [[a[1], a[0]], [b[1], b[0]]] : [a, b];
      line([scene.centre[0] + p[0], scene.centre[1] + p[1], scene.floor],
           [scene.centre[0] + q[0], scene.centre[1] + q[1], scene.floor], "#ddd", 1);
    }
    for (const track of scene.tracks) {
      const row = track.rows[frame], at = row.slice(0, 3), q = row.slice(3);
      const points = corners.map(c => turn(q, c.map(n => n * track.size)).map((n, k) => n + at[k]));
      for (const [i, j] of edges) line(points[i], points[j], track.colour, 2);
      for (let k = 1; k <= frame; k++) line(track.rows[k - 1], track.rows[k], track.colour, 1);
    }
    label.textContent = (frame * scene.step).toFixed(2) + " s";
  }
  function play(now) {
    if (!playing) return;
    const frame = Math.floor((now - begun) / 1000 * scene.speed / scene.step);
    slider.value = frame; show();
    if (frame >= scene.frames) { playing = false; button.textContent = "Play"; } else requestAnimationFrame(play);
  }
  button.onclick = () => {
    playing = !playing; button.textContent = playing ? "Stop" : "Play"; begun = performance.now();
    if (playing) requestAnimationFrame(play);
  };
  slider.oninput = () => { playing = false; button.textContent = "Play"; show(); };
  canvas.onpointermove = event => {
    if (!event.buttons) return;
    yaw -= event.movementX * .01;
    pitch = Math.max(0, Math.min(1.5, pitch + event.movementY * .01));
    show();
  };
  show();
}
"""


def write_page(path: Path, tosses: TossResult | None, pushes: list[PushResult]) -> None:
    """Writes the page, which needs no other file and no network."""
    scenes: list[dict[str, Any]] = []
    sections = []
    for scene, title in _scenes(tosses, pushes):
        scene["id"] = f"scene{len(scenes)}"
        scenes.append(scene)
        sections.append(
            f'<section id="{scene["id"]}"><h2>{html.escape(title)}</h2><canvas></canvas><div class="bar">'
            '<button>Play</button><input type="range" min="0" aria-label="time"><output></output></div></section>'
        )
    data = json.dumps(scenes, separators=(",", ":")).replace("</", "<\\/")
    text = f"{_HEAD}{''.join(sections)}<script>\nconst scenes = {data};\n{_SCRIPT}</script></body></html>\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(path) as part:
        part.write_text(text, encoding="utf-8")


def _scenes(tosses: TossResult | None, pushes: list[PushResult]) -> list[tuple[dict[str, Any], str]]:
    found = []
    if tosses is not None:
        for name, index in chosen_tosses(tosses).items():
            toss = tosses.data.tosses[index]
            real = np.hstack([toss.position, toss.quaternion])
            tracks = {
                "real": (real, tosses.data.side),
                "simulated": (np.hstack(tosses.simulated(index)), tosses.data.side),
            }
            along = toss.position[-1] - toss.position[0]
            yaw = float(np.arctan2(along[1], along[0]))
            scene = _scene(tracks, 1.0 / tosses.data.frame_rate, 0.25, 0.0, yaw)
            found.append((scene, f"The {name} toss: {toss.name}"))
    for each in pushes:
        if each.poses is not None:
            mean = mean_poses([run.poses for run in each.runs])
            scene = _scene({**_arm("real", mean), **_arm("simulated", each.poses)}, STEP_S, 2.0, -0.055, 0.0)
            found.append((scene, f"Arm, experiment {each.experiment}: hand (small) and cube"))
    return found


def _arm(name: str, poses: PushPoses) -> dict[str, tuple[np.ndarray, float]]:
    hand = np.hstack([poses.hand_position, poses.hand_quaternion])
    return {
        f"{name} hand": (hand, 0.05),
        f"{name} cube": (np.hstack([poses.cube_position, poses.cube_quaternion]), 0.075),
    }


def _scene(
    tracks: dict[str, tuple[np.ndarray, float]], step_s: float, speed: float, floor: float, yaw: float
) -> dict[str, Any]:
    places = np.concatenate([rows[:, :3] for rows, _ in tracks.values()])
    low, high = places.min(0), places.max(0)
    return {
        "tracks": [
            {
                "rows": np.round(rows, 4).tolist(),
                "size": size,
                "colour": "#666" if name.startswith("real") else "#e67e00",
            }
            for name, (rows, size) in tracks.items()
        ],
        "frames": min(len(rows) for rows, _ in tracks.values()),
        "step": step_s,
        "speed": speed,
        "floor": floor,
        "yaw": yaw,
        "centre": ((low + high) / 2.0).tolist(),
        "scale": float(480.0 / max(*(high - low), 0.3)),
    }
