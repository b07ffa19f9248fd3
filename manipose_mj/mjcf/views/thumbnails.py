"""Small pictures of assets with their label drawn over them, all seen from the same side of the label.

Objects of a category whose labels agree look alike: up, front and grip are in the same place. A label that
is wrong shows at a glance.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float
from PIL import Image, ImageDraw

from manipose_mj.assets.asset import Asset
from manipose_mj.assets.label_marks import Line, label_lines
from manipose_mj.assets.physics import COLLISION_GROUP
from manipose_mj.mjcf.cameras.pictures import Engine, painter
from manipose_mj.mjcf.cameras.ray_camera import camera_intrinsics, camera_pose
from manipose_mj.poses import compose, invert, rotation_to_quaternion, transform, vector_to_pose

CAMERA = "thumbnail"
FIELD_OF_VIEW = 20.0  # [deg]
BACKGROUND = (0.93, 0.94, 0.95)
# Where the camera stands, and what is up in the picture, in the label frame. Tools lie along the
# picture; all else stands upright, its front turned a little to the left.
TOOL_VIEW = ((0.25, 0.60, 0.85), (0.0, 1.0, 0.0))
UPRIGHT_VIEW = ((0.50, 0.80, 0.55), (1.0, 0.0, 0.0))
AJAR = 0.35  # share of its range to which every joint is open
SMOOTH = 3  # lines are drawn so much larger, and reduced
CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)


def thumbnail(asset: Asset, size: int, *, engine: Engine = "auto") -> Image.Image:
    """A square picture with the axes of the label, of handles and of joints, visible through the object.

    Args:
      asset: Its model is loaded; moving parts are shown ajar.
      size: Of the picture [pixels].
      engine: As for `pictures.render`.
    """
    lines = label_lines(asset)
    model = _stage(asset)
    data = mujoco.MjData(model)
    for part in asset.parts:
        low, high = part.joint.range
        data.joint(part.name).qpos = low + AJAR * (high - low)
    mujoco.mj_forward(model, data)
    ends = [end for line in lines for end in _ends(model, data, line)]
    _aim(model, asset, np.concatenate([_corners(model, data), np.stack(ends)]))
    mujoco.mj_forward(model, data)
    with painter(model, size, size, engine=engine) as paint:
        picture = Image.fromarray(paint.paint(data, CAMERA))
    return _overlaid(picture, model, data, lines)


def _stage(asset: Asset) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_file(str(asset.model_path))
    spec.visual.headlight.ambient = [0.45] * 3
    spec.visual.headlight.diffuse = [0.35] * 3
    spec.visual.headlight.specular = [0.05] * 3
    spec.visual.map.znear = 0.01
    spec.worldbody.add_camera(name=CAMERA, fovy=FIELD_OF_VIEW)
    light = spec.worldbody.add_light(name=CAMERA, castshadow=False)
    light.type, light.diffuse = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, [0.35] * 3
    sky = spec.add_texture(name=CAMERA, type=mujoco.mjtTexture.mjTEXTURE_SKYBOX)
    sky.builtin, sky.width, sky.height = mujoco.mjtBuiltin.mjBUILTIN_FLAT, 8, 48
    sky.rgb1, sky.rgb2 = BACKGROUND, BACKGROUND
    return spec.compile()


def _aim(model: mujoco.MjModel, asset: Asset, points: Float[np.ndarray, "n 3"]) -> None:
    """Turn the camera to the label's side, at the distance from which all points are in view."""
    tool = asset.label.object_type == "functional"
    eye, up = (np.array(v) for v in (TOOL_VIEW if tool else UPRIGHT_VIEW))
    back = asset.label.rotation @ (eye / np.linalg.norm(eye))
    right = np.cross(asset.label.rotation @ up, back)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(back, right), back], axis=1)
    own = points @ rotation
    low, high = own.min(axis=0), own.max(axis=0)
    middle = (low + high) / 2
    reach = 1.04 * max(high[0] - low[0], high[1] - low[1]) / 2
    middle[2] = high[2] + reach / np.tan(np.deg2rad(FIELD_OF_VIEW / 2))
    camera, light = model.camera(CAMERA), model.light(CAMERA)
    camera.pos, camera.quat = rotation @ middle, rotation_to_quaternion(rotation)
    light.dir = rotation @ np.array([0.4, -0.7, -0.6])


def _corners(model: mujoco.MjModel, data: mujoco.MjData) -> Float[np.ndarray, "n 3"]:
    """Corners of the boxes around what is seen, in the world frame."""
    points = []
    for geom in np.flatnonzero(model.geom_group < COLLISION_GROUP):
        middle, half = model.geom_aabb[geom].reshape(2, 3)
        rotation = data.geom_xmat[geom].reshape(3, 3)
        points.append(transform(compose(rotation, data.geom_xpos[geom]), middle + CORNERS * half))
    return np.concatenate(points)


def _ends(
    model: mujoco.MjModel, data: mujoco.MjData, line: Line
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """The line's ends in the world frame, where the body that carries it is now."""
    body = 1 if line.body is None else model.body(line.body).id
    T_world_body = vector_to_pose(np.concatenate([data.xpos[body], data.xquat[body]]))
    start, end = transform(T_world_body, np.stack([line.start, line.end]))
    return start, end


def _overlaid(
    picture: Image.Image, model: mujoco.MjModel, data: mujoco.MjData, lines: tuple[Line, ...]
) -> Image.Image:
    size = picture.width
    camera = camera_intrinsics(model, CAMERA, size, size)
    T_camera_world = invert(camera_pose(model, data, CAMERA))
    layer = Image.new("RGBA", (size * SMOOTH, size * SMOOTH))
    pen = ImageDraw.Draw(layer)
    width = max(2, size // 90) * SMOOTH
    spans = [transform(T_camera_world, np.stack(_ends(model, data, line))) for line in lines]
    # What is nearer is drawn over what is farther.
    for index in sorted(range(len(lines)), key=lambda i: -spans[i][:, 2].mean()):
        xy = spans[index][:, :2] / spans[index][:, 2:] * (camera.fx, camera.fy)
        xy = (xy + (camera.cx, camera.cy) + 0.5) * SMOOTH
        colour = tuple(round(255 * c) for c in lines[index].colour)
        pen.line([tuple(p) for p in xy], fill=(255, 255, 255, 160), width=width + 2 * SMOOTH)
        pen.line([tuple(p) for p in xy], fill=(*colour, 255), width=width)
    return Image.alpha_composite(
        picture.convert("RGBA"), layer.resize(picture.size, Image.Resampling.BOX)
    ).convert("RGB")
