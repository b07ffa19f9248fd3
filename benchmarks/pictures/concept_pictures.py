"""Draw the pictures of the concept pages: python benchmarks/pictures/concept_pictures.py [docs/concepts].

labels.webp shows one object of each kind of label with its axes; frames.webp the frames of a scene.
"""

from __future__ import annotations

import io
import tempfile
from pathlib import Path

import numpy as np
import tyro
from jaxtyping import Float
from PIL import Image, ImageDraw, ImageFont

from manipose_mj import suite
from manipose_mj.assets.catalogue import draft
from manipose_mj.mjcf.cameras.pictures import render
from manipose_mj.mjcf.cameras.ray_camera import camera_intrinsics, camera_pose
from manipose_mj.mjcf.views.film import film_strip
from manipose_mj.mjcf.views.thumbnails import thumbnail
from manipose_mj.poses import invert, transform

SPECIMENS = {
    "bowl": "bowl: axis of revolution",
    "mug": "mug: one mirror plane",
    "pot": "pot: two mirror planes",
    "box": "box: three mirror planes",
    "hammer": "hammer: functional tool",
    "cabinet": "cabinet: handles and joints",
}
THUMBNAIL = 240
SCENE = ("single_object", "target_pose", 4)  # a mug that lies far from its goal
VIEW = "overview"
WIDTH, HEIGHT, SMOOTH = 720, 480, 2
AXIS_LENGTH = 0.12  # [m]
AXIS_COLOURS = ((220, 40, 40), (30, 160, 60), (40, 90, 230))
QUALITY = 85


def labels() -> Image.Image:
    """One object of each kind of label, seen from the same side, with its axes."""
    pictures = []
    for category in SPECIMENS:
        with tempfile.TemporaryDirectory(prefix="manipose-concepts-") as folder:
            large = thumbnail(draft(category, 0, Path(folder)), 2 * THUMBNAIL, engine="ray")
        pictures.append(np.asarray(large.resize((THUMBNAIL, THUMBNAIL), Image.Resampling.BOX)))
    strip = film_strip(pictures, list(SPECIMENS.values()), columns=3)
    return Image.open(io.BytesIO(strip)).convert("RGB")


def frames() -> Image.Image:
    """A scene with the axes of its frames drawn over it."""
    domain, task, seed = SCENE
    environment = suite.load(domain, task, seed=0)
    environment.random_state.seed(seed)
    observation = environment.reset().observation
    physics = environment.physics
    model, data = physics.model.ptr, physics.data.ptr
    T_world_object = observation["pose/object"]
    T_world_robot = T_world_object @ invert(observation["pose/robot/object"])
    T_world_camera = T_world_object @ invert(observation["pose/cameras/object"][0])
    named = {
        "robot base": T_world_robot,
        "object": T_world_object,
        "goal": observation["pose/goal"],
        "camera": T_world_camera,
    }
    pixels = render(model, data, VIEW, SMOOTH * HEIGHT, SMOOTH * WIDTH, engine="ray")
    picture = Image.fromarray(pixels)
    pen = ImageDraw.Draw(picture)
    font = ImageFont.load_default(15 * SMOOTH)
    camera = camera_intrinsics(model, VIEW, SMOOTH * HEIGHT, SMOOTH * WIDTH)
    T_view_world = invert(camera_pose(model, data, VIEW))
    for name, pose in named.items():
        ends = np.concatenate([np.zeros((1, 3)), AXIS_LENGTH * np.eye(3)])
        points = transform(T_view_world @ pose, ends)
        if (points[:, 2] < 0.05).any():
            continue  # behind the viewer
        xy = _pixels(points, camera)
        for end, colour in zip(xy[1:], AXIS_COLOURS, strict=True):
            line = [tuple(xy[0]), tuple(end)]
            pen.line(line, fill=(255, 255, 255), width=5 * SMOOTH)
            pen.line(line, fill=colour, width=3 * SMOOTH)
        place = (xy[0][0] + 8 * SMOOTH, xy[0][1] + 6 * SMOOTH)
        pen.text(
            place, name, fill=(20, 24, 28), font=font, stroke_width=2 * SMOOTH, stroke_fill="white"
        )
    environment.close()
    return picture.resize((WIDTH, HEIGHT), Image.Resampling.BOX)


def _pixels(points: Float[np.ndarray, "n 3"], camera) -> Float[np.ndarray, "n 2"]:
    focal, centre = (camera.fx, camera.fy), (camera.cx, camera.cy)
    return points[:, :2] / points[:, 2:] * focal + centre + 0.5


def main(out: tyro.conf.Positional[Path] = Path("docs/concepts")) -> None:
    """Write both pictures.

    Args:
      out: Their folder.
    """
    labels().save(out / "labels.webp", quality=QUALITY, method=6)
    frames().save(out / "frames.webp", quality=QUALITY, method=6)


if __name__ == "__main__":
    tyro.cli(main)
