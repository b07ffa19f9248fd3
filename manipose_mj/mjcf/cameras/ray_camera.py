"""A depth, segmentation and normal camera that needs no GL."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np
from jaxtyping import Float, Int

from manipose_mj.errors import InputError, unknown_name
from manipose_mj.mjcf.cameras.ray_casting import RayBundles, bundle_rays, cast_rays
from manipose_mj.mjcf.cameras.ray_memory import RayMemory
from manipose_mj.poses import compose


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole in pixels: `u = fx x / z + cx`, `v = fy y / z + cy` in the camera frame.

    The camera frame is OpenCV's: x right, y down, z forward. A pixel's centre has whole
    coordinates: `(0, 0)` is the centre of the top left pixel.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    @property
    def matrix(self) -> Float[np.ndarray, "3 3"]:
        """OpenCV's and BOP's K."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def slopes(self) -> Float[np.ndarray, "height width 2"]:
        """`(x / z, y / z)` of the ray through each pixel's centre."""
        u = (np.arange(self.width) - self.cx) / self.fx
        v = (np.arange(self.height) - self.cy) / self.fy
        return np.stack(np.meshgrid(u, v), axis=-1)


@dataclass(frozen=True)
class RayImage:
    """What a camera saw.

    Attributes:
      depth: `(height, width)` float32 [m], along the optical axis; 0 where nothing was seen, as
        depth sensors report it.
      geom_id: `(height, width)` int32; -1 where nothing was seen.
      normal: `(height, width, 3)` float32, world frame, towards the camera; 0 where nothing was.
    """

    depth: Float[np.ndarray, "height width"]
    geom_id: Int[np.ndarray, "height width"]
    normal: Float[np.ndarray, "height width 3"]


@dataclass(frozen=True)
class RayCamera:
    """Renders any camera of a model at this size [pixels].

    Sees geoms of groups 0-2 that are not fully transparent; not sites, flexes, skins. Pixel centres
    and field of view are those of MuJoCo's GL renderer, and so is the far clipping plane; the near
    one is not.
    """

    height: int = 120
    width: int = 160

    def __post_init__(self) -> None:
        if self.height < 1 or self.width < 1:
            raise InputError(
                f"camera size {self.height} x {self.width}: height and width must be positive"
            )

    def render(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        camera: int | str,
        memory: RayMemory | None = None,
    ) -> RayImage:
        """Depth, segmentation and normals.

        Args:
          model: The compiled model.
          data: Its state after `mj_forward` (or a step).
          camera: Name or id.
          memory: Of this camera's pictures: quicker where most of what it sees stands still.

        Raises:
          InputError: No such camera, or it is orthographic.
        """
        camera = camera_id(model, camera)
        bundles = image_rays(camera_intrinsics(model, camera, self.height, self.width))
        cast = cast_rays if memory is None else memory.cast
        hits = cast(model, data, camera_pose(model, data, camera), bundles)
        shape = (self.height, self.width)
        far = float(model.vis.map.zfar * model.stat.extent)
        hits = hits.within(far)
        # Rays have z = 1 in the camera frame, so that a hit's scale is its depth.
        return RayImage(
            depth=np.maximum(hits.scale, 0.0).astype(np.float32).reshape(shape),
            geom_id=hits.geom_id.reshape(shape),
            normal=hits.normal.astype(np.float32).reshape(*shape, 3),
        )


def camera_id(model: mujoco.MjModel, camera: int | str) -> int:
    """The id of a camera given by name or id.

    Raises:
      InputError: There is none.
    """
    if isinstance(camera, str):
        index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, camera)
        if index < 0:
            raise unknown_name("camera", camera, [model.camera(i).name for i in range(model.ncam)])
        return index
    if not 0 <= camera < model.ncam:
        raise InputError(f"camera id {camera}: the model has {model.ncam}, counted from 0")
    return int(camera)


def camera_pose(
    model: mujoco.MjModel, data: mujoco.MjData, camera: int | str
) -> Float[np.ndarray, "4 4"]:
    """`T_world_camera` with OpenCV's camera frame: x right, y down, z forward.

    MuJoCo's own camera frame (`cam_xmat`) has y up and z backwards.
    """
    index = camera_id(model, camera)
    rotation = data.cam_xmat[index].reshape(3, 3) * np.array([1.0, -1.0, -1.0])
    return compose(rotation, data.cam_xpos[index])


def camera_intrinsics(
    model: mujoco.MjModel, camera: int | str, height: int, width: int
) -> Intrinsics:
    """The pinhole of a model's camera at an image size, as MuJoCo's GL renderer draws it.

    A camera with `sensorsize` keeps its sensor's field of view in both directions, whatever the
    image's aspect; one with `fovy` has square pixels.

    Raises:
      InputError: No such camera, or it is orthographic.
    """
    index = camera_id(model, camera)
    if model.cam_projection[index] == mujoco.mjtProjection.mjPROJ_ORTHOGRAPHIC:
        raise InputError(
            f"camera {model.camera(index).name!r} is orthographic; expected a perspective one"
        )
    sensor_width, sensor_height = (float(v) for v in model.cam_sensorsize[index])
    if sensor_width > 0 and sensor_height > 0:
        focal_x, focal_y, centre_x, centre_y = (float(v) for v in model.cam_intrinsic[index])
        fx, fy = focal_x / sensor_width * width, focal_y / sensor_height * height
        shift_x, shift_y = centre_x / sensor_width * width, centre_y / sensor_height * height
    else:
        fx = fy = 0.5 * height / np.tan(0.5 * np.radians(float(model.cam_fovy[index])))
        shift_x = shift_y = 0.0
    return Intrinsics(
        width=width,
        height=height,
        fx=float(fx),
        fy=float(fy),
        cx=0.5 * (width - 1) - shift_x,
        cy=0.5 * (height - 1) - shift_y,
    )


@lru_cache(maxsize=16)
def image_rays(intrinsics: Intrinsics) -> RayBundles:
    """The rays through the pixels' centres, row by row, in the camera frame."""
    return bundle_rays(intrinsics.slopes().reshape(-1, 2))
