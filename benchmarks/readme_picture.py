"""Draw the README's picture: the baseline storing the chips can, and a catalogue object at its goal.

python benchmarks/readme_picture.py docs/teaser.png
"""

from __future__ import annotations

import io
from pathlib import Path

import mujoco
import numpy as np
import tyro
from PIL import Image

from manipose_mj.control.episode import run_episode, scene_model
from manipose_mj.mjcf.pictures import painter

WIDTH, HEIGHT = 400, 300
ROWS = (
    ("articulated/store_chips_can_middle_drawer", 2, (0.0, 0.22, 0.63, 1.0)),
    ("single_object/target_pose", 9, (0.0, 0.45, 0.72, 1.0)),
)


def main(out: tyro.conf.Positional[Path]) -> None:
    """Run one episode of each task and paste four moments of each into one PNG."""
    rows = []
    for task, seed, moments in ROWS:
        result, trajectory = run_episode(task, episode=0, seed=seed)
        if not result.success_at_end:
            raise SystemExit(
                f"{task} with seed {seed} failed: {result.reason}; choose another seed"
            )
        model = scene_model(task, seed=seed)
        data = mujoco.MjData(model)
        frames = []
        with painter(model, HEIGHT, WIDTH, engine="ray") as paint:
            for moment in moments:
                data.qpos[:] = trajectory.qpos[round(moment * (len(trajectory.times) - 1))]
                mujoco.mj_forward(model, data)
                frames.append(paint.paint(data, "overview"))
        rows.append(np.hstack(frames))
    picture = io.BytesIO()
    Image.fromarray(np.vstack(rows)).save(picture, "PNG", optimize=True)
    out.write_bytes(picture.getvalue())


if __name__ == "__main__":
    tyro.cli(main)
