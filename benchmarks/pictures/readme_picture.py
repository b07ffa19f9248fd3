"""Film the README's picture: the baseline opens a drawer, lays the chips can inside and shuts it.

python benchmarks/pictures/readme_picture.py docs/teaser.webp
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import tyro

from manipose_mj.evaluation.episode import run_episode, scene_model
from manipose_mj.mjcf.cameras.pictures import painter
from manipose_mj.mjcf.views.film import encode_animation
from manipose_mj.tasks import EnvConfig, EpisodeSpec

TASK, SEED = "articulated/store_chips_can_middle_drawer", 2
WIDTH, HEIGHT = 480, 300
FRAMES, LAST, FPS = 84, 12, 12.0  # the last frame stays for a second
LIMIT = 1_000_000  # bytes


def main(out: tyro.conf.Positional[Path]) -> None:
    """Play one episode and write it as an animation that loops.

    Args:
      out: A WebP file; it stays below 1 MB.
    """
    start = EnvConfig(TASK, obs_mode="state"), EpisodeSpec(SEED)
    result, trajectory = run_episode(*start)
    if not result.success_at_end:
        raise SystemExit(f"{TASK} with seed {SEED} failed: {result.reason}; choose another seed")
    model = scene_model(*start)
    data = mujoco.MjData(model)
    frames = []
    with painter(model, HEIGHT, WIDTH, engine="ray") as paint:
        for frame in np.linspace(0, len(trajectory.times) - 1, FRAMES).round().astype(int):
            data.qpos[:] = trajectory.qpos[frame]
            mujoco.mj_forward(model, data)
            frames.append(paint.paint(data, "overview"))
    animation = encode_animation(frames + frames[-1:] * LAST, fps=FPS)
    if len(animation) >= LIMIT:
        raise SystemExit(f"{len(animation)} bytes; expected fewer than {LIMIT}")
    out.write_bytes(animation)
    print(f"{out}: {len(frames)} frames, {len(animation) / 1000:.0f} kB")


if __name__ == "__main__":
    tyro.cli(main)
