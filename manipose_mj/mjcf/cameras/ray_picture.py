"""Colour pictures by ray casting: one soft key light with shadows, sky and ground light, sky."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float, Int, UInt8
from scipy.ndimage import maximum_filter, minimum_filter

from manipose_mj.mjcf.cameras.ray_camera import camera_intrinsics, camera_pose, image_rays
from manipose_mj.mjcf.cameras.ray_casting import (
    PICTURE_GROUPS,
    RayBundles,
    bundle_rays,
    cast_rays,
    geom_colours,
    rotated,
    visible_geoms,
)
from manipose_mj.mjcf.cameras.surface_colours import SurfaceColours, to_display
from manipose_mj.poses import compose

_SURFACE_OFFSET = 1e-3  # [m], keeps a surface from shading itself
_FOG_DISTANCE = 14.0  # [m], where the floor fades into the horizon
_PHASES = 4  # sets of light places that neighbouring pixels take turns at
_SOLID = 0.95  # opacity from which a geom hides what is behind it and throws a shadow


@dataclass(frozen=True)
class RayShading:
    """Light and sky. Colours are linear light; strengths multiply the surface's colour.

    Attributes:
      supersampling: Rays per pixel along each axis.
      key: Strength of the light that throws shadows.
      sky: Light from above.
      ground: Light from below.
      camera_light: Light from the camera, which keeps what faces it readable.
      contrast: Between neighbouring pixels' display values, from which they are supersampled.
      light_radius: Of the key light as a share of its distance: the softness of shadows.
      zenith: Sky colour straight up.
      horizon: Sky colour at eye level, and of far floor.
    """

    supersampling: int = 2
    contrast: float = 0.03
    key: float = 1.1
    sky: tuple[float, float, float] = (0.36, 0.40, 0.46)
    ground: tuple[float, float, float] = (0.16, 0.145, 0.13)
    camera_light: float = 0.14
    light_radius: float = 0.035
    zenith: tuple[float, float, float] = (0.24, 0.40, 0.66)
    horizon: tuple[float, float, float] = (0.60, 0.69, 0.80)


class RayPainter:
    """Paints a model's cameras at one size; keeps what does not change between frames."""

    def __init__(
        self,
        model: mujoco.MjModel,
        height: int,
        width: int,
        shading: RayShading | None = None,
        *,
        groups: tuple[int, ...] = PICTURE_GROUPS,
    ) -> None:
        """Prepares.

        Args:
          model: The compiled model.
          height: In pixels.
          width: In pixels.
          shading: Light and sky.
          groups: Of the geoms that are shown.
        """
        self._model, self._groups = model, groups
        self._size = (height, width)
        self._shading = shading or RayShading()
        self._colours = SurfaceColours(model)

    def paint(self, data: mujoco.MjData, camera: int | str) -> UInt8[np.ndarray, "height width 3"]:
        """The picture that a camera of the model sees.

        One ray a pixel; then, where neighbours differ, `supersampling` squared rays (Whitted 1980).

        Raises:
          InputError: No such camera.
        """
        (height, width), samples = self._size, self._shading.supersampling
        intrinsics = camera_intrinsics(self._model, camera, height, width)
        eye = camera_pose(self._model, data, camera)
        slopes = intrinsics.slopes()
        y, x = np.indices(self._size)
        phase = (2 * y + x) % _PHASES
        # Neighbours see the light at different places of its rim, so that all of a soft shadow's
        # edge shows as contrast.
        rim = samples**2 * _PHASES - 1 - phase
        picture = self._trace(
            data, eye, image_rays(intrinsics), slopes.reshape(-1, 2), rim.ravel()
        ).reshape(height, width, 3)
        if samples > 1:
            contrast = maximum_filter(picture, (3, 3, 1)) - minimum_filter(picture, (3, 3, 1))
            rough = (contrast > self._shading.contrast).any(axis=-1)
            steps = (np.arange(samples) + 0.5) / samples - 0.5
            offset = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
            offset = offset / (intrinsics.fx, intrinsics.fy)
            xy = (slopes[rough][:, None] + offset).reshape(-1, 2)
            turn = (np.arange(samples**2) * _PHASES + phase[rough][:, None]).ravel()
            fine = self._trace(data, eye, bundle_rays(xy), xy, turn)
            # Averaging what the display shows keeps bright edges smooth.
            picture[rough] = fine.reshape(-1, samples**2, 3).mean(axis=1)
        return np.round(255 * picture).astype(np.uint8)

    def close(self) -> None:
        """Nothing to free."""

    def _trace(
        self,
        data: mujoco.MjData,
        T_world_camera: Float[np.ndarray, "4 4"],
        bundles: RayBundles,
        xy: Float[np.ndarray, "n 2"],
        turn: Int[np.ndarray, "n"],
    ) -> Float[np.ndarray, "n 3"]:
        """Display values in 0..1 along the rays of the given slopes; `turn` is each ray's light."""
        alpha = geom_colours(self._model)[:, 3]
        shown = visible_geoms(self._model, self._groups)
        rays = np.concatenate([xy, np.ones((len(xy), 1))], axis=1)
        rays = rotated(rays, T_world_camera[:3, :3])
        unit = (rays / np.linalg.norm(rays, axis=1, keepdims=True)).astype(np.float32)
        picture = self._sky(unit)
        solid = cast_rays(
            self._model, data, T_world_camera, bundles, shown=shown & (alpha >= _SOLID)
        )
        layers = [(solid, np.ones_like(alpha))]
        glass = shown & (alpha < _SOLID)
        if glass.any():
            film = cast_rays(self._model, data, T_world_camera, bundles, shown=glass)
            film.geom_id[(solid.scale >= 0) & (film.scale > solid.scale)] = -1
            layers.append((film, alpha))
        for hits, cover in layers:
            rows = np.flatnonzero(hits.geom_id >= 0)
            if len(rows):
                geom_id, distance = hits.geom_id[rows], hits.scale[rows, None] * rays[rows]
                points = T_world_camera[:3, 3] + distance
                normal = hits.normal[rows].astype(np.float32)
                colour = self._shade(data, points, normal, -unit[rows], geom_id, turn[rows])
                haze = 1 - np.exp(-np.sum(distance**2, axis=1, keepdims=True) / _FOG_DISTANCE**2)
                colour += haze.astype(np.float32) * (
                    np.array(self._shading.horizon, np.float32) - colour
                )
                picture[rows] += cover[geom_id, None] * (colour - picture[rows])
        return to_display(_tone(picture))

    def _shade(
        self,
        data: mujoco.MjData,
        points: Float[np.ndarray, "n 3"],
        normals: Float[np.ndarray, "n 3"],
        to_eye: Float[np.ndarray, "n 3"],
        geom_id: Int[np.ndarray, "n"],
        turn: Int[np.ndarray, "n"],
    ) -> Float[np.ndarray, "n 3"]:
        """Lambert under key, sky, ground and camera light, and a little gloss (Blinn 1977)."""
        shading = self._shading
        light = key_light(self._model, data)
        to_light = (light - points).astype(np.float32)
        to_light /= np.linalg.norm(to_light, axis=1, keepdims=True)
        key = np.maximum(np.einsum("ij,ij->i", normals, to_light), 0.0)
        facing = np.flatnonzero(key > 0)
        raised = points[facing] + _SURFACE_OFFSET * normals[facing]
        key[facing] *= self._lit(data, light, raised, turn[facing])
        key = key[:, None]
        up = 0.5 + 0.5 * normals[:, 2:]
        around = np.array(shading.ground, np.float32) + up * (
            np.array(shading.sky, np.float32) - np.array(shading.ground, np.float32)
        )
        towards = np.maximum(np.einsum("ij,ij->i", normals, to_eye), 0.0)[:, None]
        light_sum = shading.key * key + around + shading.camera_light * towards
        halfway = to_light + to_eye
        halfway /= np.maximum(np.linalg.norm(halfway, axis=1, keepdims=True), 1e-9)
        gloss = np.maximum(np.einsum("ij,ij->i", normals, halfway), 0.0)[:, None] ** 40
        return self._colours.at(data, points, geom_id) * light_sum + 0.1 * gloss * (key > 0)

    def _lit(
        self,
        data: mujoco.MjData,
        light: Float[np.ndarray, "3"],
        points: Float[np.ndarray, "n 3"],
        turn: Int[np.ndarray, "n"],
    ) -> np.ndarray:
        """`(n,)` bool: whether the key light reaches the points.

        `mj_multiRay` takes one origin, so rays go from the light to the points. Each of a pixel's
        rays sees the light at another place of its disc: averaged, shadows get soft edges.
        """
        lit = np.ones(len(points), bool)
        if not len(points):
            return lit
        solid = visible_geoms(self._model) & (geom_colours(self._model)[:, 3] >= _SOLID)
        axis = np.median(points, axis=0) - light
        distance = float(np.linalg.norm(axis))
        rotation = _looking_along(axis / distance)
        places = self._shading.supersampling**2 * _PHASES
        radius = self._shading.light_radius * distance
        for place in range(places):
            # Vogel's sunflower covers the disc evenly, and so does every fourth of its seeds.
            angle, reach = place * np.pi * (3 - np.sqrt(5)), np.sqrt((place + 0.5) / places)
            shift = np.cos(angle) * rotation[:, 0] + np.sin(angle) * rotation[:, 1]
            T_world_light = compose(rotation, light + radius * reach * shift)
            mine = np.flatnonzero(turn == place)
            local = rotated(points[mine] - T_world_light[:3, 3], rotation.T)
            before = local[:, 2] > _SURFACE_OFFSET  # what lies beside the light is lit
            mine, local = mine[before], local[before]
            bundles = bundle_rays(local[:, :2] / local[:, 2:])
            hits = cast_rays(self._model, data, T_world_light, bundles, shown=solid)
            lit[mine] = (hits.scale < 0) | (hits.scale >= local[:, 2] - 1e-6)
        return lit

    def _sky(self, unit: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        height = np.clip(unit[:, 2:], 0.0, 1.0) ** np.float32(0.6)
        horizon, zenith = (
            np.array(self._shading.horizon, np.float32),
            np.array(self._shading.zenith, np.float32),
        )
        return horizon + height * (zenith - horizon)


def key_light(model: mujoco.MjModel, data: mujoco.MjData) -> Float[np.ndarray, "3"]:
    """Where the light that throws shadows is.

    That is the model's first active light that does, or else a place above the scene.
    A directional light is put far out against its direction.
    """
    centre = np.asarray(model.stat.center, float)
    for light in range(model.nlight):
        if not (model.light_active[light] and model.light_castshadow[light]):
            continue
        if model.light_type[light] != mujoco.mjtLightType.mjLIGHT_DIRECTIONAL:
            return data.light_xpos[light].copy()
        if data.light_xdir[light, 2] < -0.1:
            return centre - 8.0 * data.light_xdir[light]
    return centre + np.array([2.0, -3.0, 6.0])


def _tone(linear: np.ndarray) -> np.ndarray:
    """Compress highlights; dark and middle tones stay (a shoulder above 0.7)."""
    over = np.maximum(linear - 0.7, 0.0)
    return np.where(linear > 0.7, 0.7 + over / (1 + over / 0.3), linear)


def _looking_along(axis: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """A rotation whose third column is `axis`."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)
