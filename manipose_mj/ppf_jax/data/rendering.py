"""Partial, noisy clouds of an object, rendered without GL by the tasks' pinhole.

A view is drawn at its exact depth, gets the noise of a structured-light camera, is cut out by an outline that
strays into what is behind, and given the normals that the noisy depth supports.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import trimesh
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter, zoom
from scipy.spatial.transform import Rotation

from manipose_mj.assets.geometry import Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras.depth_noise import KINECT, StructuredLight, structured_light
from manipose_mj.mjcf.cameras.depth_normals import depth_normals
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics
from manipose_mj.poses import compose, invert, transform
from manipose_mj.ppf_jax.data.occlusion import Occluder, nearer, occluded
from manipose_mj.ppf_jax.data.rasteriser import Raster, Triangles, pixel_rays, rasterise
from manipose_mj.ppf_jax.data.view_settings import (
    Placement,
    ViewSetting,
    place,
    place_before_several,
)
from manipose_mj.ppf_jax.points.clouds import MAX_POINTS, LabelledCloud

MIN_POINTS = 32  # a view with fewer is drawn again: nobody can say anything about it
MARGIN = 10  # around the object, for what bleeds into its outline [pixels]
_DRAWS = 40
_CALIBRATION = (np.deg2rad(0.2), 0.001)  # deviations of cameras' poses to one another [rad, m]


@dataclass(frozen=True)
class Subject:
    """An object to be rendered.

    Attributes:
      name: Such as `mug_003`.
      category: What estimators are told.
      label: In the mesh frame.
      triangles: The surface, mesh frame.
      bounds: `(2, 3)` of the surface, mesh frame [m].
      hull: Corners of its convex hull, mesh frame [m].
      rests: `(R_world_mesh, height [m], probability)` of the ways it lies on a table; may be empty where
        no setting with a table is rendered.
      shapes: What the surface is made of, with colours; may be empty where nobody asks for colours.
    """

    name: str
    category: str
    label: PoseLabel
    triangles: Triangles
    bounds: Float[np.ndarray, "2 3"]
    hull: Float[np.ndarray, "h 3"]
    rests: tuple[tuple[Float[np.ndarray, "3 3"], float, float], ...] = ()
    shapes: tuple[Shape, ...] = ()

    @classmethod
    def of_mesh(
        cls,
        mesh: trimesh.Trimesh,
        label: PoseLabel,
        *,
        name: str,
        category: str,
        rests: Sequence[tuple[Float[np.ndarray, "3 3"], float, float]] = (),
        shapes: Sequence[Shape] = (),
    ) -> Subject:
        """The subject with this surface."""
        bounds, hull = np.asarray(mesh.bounds, float), np.asarray(mesh.convex_hull.vertices)
        triangles = Triangles.of_mesh(mesh)
        return cls(name, category, label, triangles, bounds, hull, tuple(rests), tuple(shapes))


@dataclass(frozen=True)
class View:
    """One drawn view, before it becomes a cloud.

    Attributes:
      depth: As the sensor reports it, 0 where nothing was measured [m].
      mask: The object's pixels as a segmentation reports them.
      exact: What is there.
      intrinsics: Of this window of the image.
      placement: Where the object is, in which image, and on what.
    """

    depth: Float[np.ndarray, "height width"]
    mask: Bool[np.ndarray, "height width"]
    exact: Raster
    intrinsics: Intrinsics
    placement: Placement

    @property
    def T_camera_mesh(self) -> Float[np.ndarray, "4 4"]:
        """Where the object is."""
        return self.placement.T_camera_mesh


def render_clouds(
    subject: Subject,
    setting: ViewSetting,
    views: int,
    rng: np.random.Generator,
    *,
    occluders: Sequence[Occluder] = (),
    first: int = 0,
) -> list[LabelledCloud]:
    """Clouds of `views` views.

    Args:
      subject: What is seen.
      setting: From where, and how well.
      views: How many.
      rng: Draws all that is random.
      occluders: What may stand in front, besides boxes.
      first: Number of the first view, for the clouds' names.

    Raises:
      InputError: The setting has a table and the subject no way to lie on it, or hardly any view
        shows enough of the object.
    """
    if setting.cameras != (1, 1):
        numbers = range(first, first + views)
        return [_fused(subject, setting, rng, occluders, f"{subject.name}/{i}") for i in numbers]
    drawn = drawn_views(subject, setting, views, rng, occluders=occluders, first=first)
    return [cloud for _, cloud in drawn]


def drawn_views(
    subject: Subject,
    setting: ViewSetting,
    views: int,
    rng: np.random.Generator,
    *,
    occluders: Sequence[Occluder] = (),
    first: int = 0,
) -> Iterator[tuple[View, LabelledCloud]]:
    """The same views, each with its cloud; arguments and errors are those of `render_clouds`."""
    if setting.placement != "anywhere" and not subject.rests:
        raise InputError(f"{subject.name}: setting {setting.name!r} needs its resting poses")
    for number in range(first, first + views):
        for _ in range(_DRAWS):
            view = render_view(subject, setting, rng, occluders=occluders)
            cloud = _cloud(subject, view, rng, f"{subject.name}/{number}")
            if len(cloud) >= MIN_POINTS:
                yield view, cloud
                break
        else:
            raise InputError(
                f"{subject.name}: {_DRAWS} views of setting {setting.name!r} in a row show fewer than "
                f"{MIN_POINTS} points; is it in metres, and are {min(setting.image_heights)} rows enough? "
                f"Its box is {np.ptp(subject.bounds, axis=0)} m"
            )


def render_view(
    subject: Subject,
    setting: ViewSetting,
    rng: np.random.Generator,
    *,
    occluders: Sequence[Occluder] = (),
) -> View:
    """Draw one view; only the window of the image that holds the object."""
    return view_of(
        subject, setting, place(setting, *_drawn_by(subject), rng), rng, occluders=occluders
    )


def view_of(
    subject: Subject,
    setting: ViewSetting,
    placement: Placement,
    rng: np.random.Generator,
    *,
    occluders: Sequence[Occluder] = (),
) -> View:
    """The view of an object that is somewhere."""
    radius = _drawn_by(subject)[1]
    window = _window(subject, placement)
    drawn = rasterise([(subject.triangles, placement.T_camera_mesh)], window)
    if rng.random() < setting.occluded:
        drawn = occluded(drawn, radius, window, rng, occluders)
    drawn = grounded(drawn, placement, window)
    mask = _bled(drawn.item == 0, setting.bleed * window.fx / KINECT.focal, rng)
    depth = measured(drawn, window, rng, setting.sensor)
    return View(depth, mask, drawn, window, placement)


def measured(
    drawn: Raster, window: Intrinsics, rng: np.random.Generator, sensor: StructuredLight | None
) -> Float[np.ndarray, "height width"]:
    """Depth as a sensor reports it, 0 where it measures nothing [m]; exact where there is none."""
    if sensor is None:
        return drawn.depth
    rays = pixel_rays(window)
    cosine = -np.einsum("hwi,hwi->hw", drawn.normal, rays) / np.linalg.norm(rays, axis=-1)
    return structured_light(drawn.depth, cosine, window, rng, sensor)


def cloud_of_view(
    view: View, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
    """Points and normals of at most `MAX_POINTS` random pixels of the object, camera frame."""
    pixels = np.argwhere(view.mask & (view.depth > 0))
    pixels = pixels[rng.permutation(len(pixels))[:MAX_POINTS]]
    normals = depth_normals(view.depth, view.mask, pixels, view.intrinsics)
    rays = pixel_rays(view.intrinsics)[pixels[:, 0], pixels[:, 1]]
    points = rays * view.depth[pixels[:, 0], pixels[:, 1]][:, None]
    return points.astype(np.float32), normals.astype(np.float32)


def _fused(
    subject: Subject,
    setting: ViewSetting,
    rng: np.random.Generator,
    occluders: Sequence[Occluder],
    name: str,
) -> LabelledCloud:
    """What several cameras see, in the frame of the one that sees most; at most `MAX_POINTS / 4` of each."""
    for _ in range(_DRAWS):
        placements = place_before_several(setting, *_drawn_by(subject), rng)
        views = [view_of(subject, setting, each, rng, occluders=occluders) for each in placements]
        seen = [(view.T_camera_mesh, *cloud_of_view(view, rng)) for view in views]
        seen = [each for each in seen if len(each[1])]
        if sum(len(points) for _, points, _ in seen) >= MIN_POINTS:
            break
    else:
        raise InputError(
            f"{subject.name}: {_DRAWS} rigs of setting {setting.name!r} in a row see fewer than {MIN_POINTS} points"
        )
    main = max(seen, key=lambda each: len(each[1]))[0]
    points, normals, eyes = [], [], []
    for pose, own, towards in seen:
        turn, shift = np.eye(3), np.zeros(3)
        if pose is not main:
            across = main @ invert(pose) @ _miscalibration(rng)
            turn, shift = across[:3, :3], across[:3, 3]
        few = own[: MAX_POINTS // 4]
        points.append(few @ turn.T + shift)
        normals.append(towards[: len(few)] @ turn.T)
        eyes.append(np.broadcast_to(shift, few.shape))
    cloud = [np.concatenate(rows).astype(np.float32) for rows in (points, normals, eyes)]
    return LabelledCloud(
        points=cloud[0],
        normals=cloud[1],
        pose=(main @ subject.label.pose).astype(np.float32),
        extents=np.asarray(subject.label.extents, np.float32),
        symmetry=subject.label.symmetry,
        name=name,
        category=subject.category,
        eyes=cloud[2],
    )


def _miscalibration(rng: np.random.Generator) -> Float[np.ndarray, "4 4"]:
    turn, shift = _CALIBRATION
    return compose(
        Rotation.from_rotvec(rng.normal(0.0, turn, 3)).as_matrix(), rng.normal(0.0, shift, 3)
    )


def _drawn_by(
    subject: Subject,
) -> tuple[Float[np.ndarray, "3"], float, list[tuple[Float[np.ndarray, "3 3"], float, float]]]:
    """What placements are drawn by: the box's centre, half its diagonal, ways to lie."""
    radius = 0.5 * float(np.linalg.norm(np.ptp(subject.bounds, axis=0)))
    return subject.bounds.mean(axis=0), radius, list(subject.rests)


def _cloud(subject: Subject, view: View, rng: np.random.Generator, name: str) -> LabelledCloud:
    points, normals = cloud_of_view(view, rng)
    return LabelledCloud(
        points=points,
        normals=normals,
        pose=(view.T_camera_mesh @ subject.label.pose).astype(np.float32),
        extents=np.asarray(subject.label.extents, np.float32),
        symmetry=subject.label.symmetry,
        name=name,
        category=subject.category,
    )


def _window(subject: Subject, placement: Placement) -> Intrinsics:
    """The part of the image that can show the object, at least a pixel."""
    k, placed = placement.intrinsics, transform(placement.T_camera_mesh, subject.hull)
    placed = placed[placed[:, 2] > 0.01]
    u = np.clip(k.fx * placed[:, 0] / placed[:, 2] + k.cx, 0, k.width - 1)
    v = np.clip(k.fy * placed[:, 1] / placed[:, 2] + k.cy, 0, k.height - 1)
    left, top = max(int(u.min()) - MARGIN, 0), max(int(v.min()) - MARGIN, 0)
    right = min(int(u.max()) + MARGIN + 2, k.width)
    bottom = min(int(v.max()) + MARGIN + 2, k.height)
    return replace(k, width=right - left, height=bottom - top, cx=k.cx - left, cy=k.cy - top)


def grounded(drawn: Raster, placement: Placement, window: Intrinsics) -> Raster:
    """The same before the placement's plane, as item 2."""
    if placement.ground is None:
        return drawn
    point, normal = placement.ground
    along = pixel_rays(window) @ normal
    reached = along < -1e-6
    depth = np.where(reached, (point @ normal) / np.where(reached, along, -1.0), 0.0)
    shape = drawn.depth.shape
    plane = Raster(depth, np.full(shape, 2, np.int32), np.broadcast_to(normal, (*shape, 3)))
    # What touches the plane lies a rounding error beneath it.
    return nearer(replace(plane, depth=plane.depth * (1 + 1e-6)), drawn)


def _bled(
    mask: Bool[np.ndarray, "height width"], reach: float, rng: np.random.Generator
) -> Bool[np.ndarray, "height width"]:
    """A mask whose outline strays smoothly by about `reach` pixels to both sides."""
    if reach <= 0 or not mask.any():
        return mask
    soft = gaussian_filter(mask.astype(np.float32), reach, truncate=2.5)
    coarse = rng.standard_normal([-(-side // 8) + 1 for side in mask.shape])
    scale = [side / grid for side, grid in zip(mask.shape, coarse.shape, strict=True)]
    field = zoom(coarse, scale, order=1)[: mask.shape[0], : mask.shape[1]]
    # The blurred step passes its value at one deviation beside the edge, 0.34 from the half.
    return soft > np.clip(0.5 + 0.34 * field, 0.02, 0.98)
