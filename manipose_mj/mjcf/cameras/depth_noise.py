"""What a structured-light camera makes of a depth image: pure functions of arrays, NumPy's or JAX's.

Figures are the first Kinect's. Nguyen, Izadi, Lovell, "Modeling Kinect sensor noise for improved 3D
reconstruction and tracking" (3DIMPVT 2012): standard deviations of depth and of edges as functions of
depth and of the angle of incidence. Khoshelham, Elberink, "Accuracy and resolution of Kinect depth
data for indoor mapping applications" (Sensors 2012): the steps of depth and the baseline. Noise is
drawn for each pixel by itself; the real sensor's is smooth over a few pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras.ray_camera import Intrinsics
from manipose_mj.poses import Array, namespace

# The models' hyperbolas end at a right angle, the measurements they fit some degrees before.
_STEEPEST = np.deg2rad(85.0)
_EDGE = 0.01  # change of depth, beyond that of the surface's slope, that makes an edge [m]


@dataclass(frozen=True)
class StructuredLight:
    """A projector and a camera.

    Attributes:
      focal: Focal length to which pixels of the sources refer; noise keeps its angle in images
        of other sizes [pixels].
      disparity_step: Depth `z` is reported in steps of `disparity_step * z**2`; 0: without steps [1/m].
      baseline: From the camera to the projector, along the camera's x [m].
      grazing: Angle of incidence from where pixels begin to fail, and where all have [rad]. The
        sources measured to some 80 deg; the ramp between is our assumption.
      speckle: Share of pixels that fail anywhere; our assumption.
      near, far: Limits of what is measured [m]; near as of PrimeSense's short-range model.
      noise: Factor of all standard deviations, for sensors better or worse than the sources'; 0: none.

    Raises:
      InputError: A figure is none of a sensor; names the field.
    """

    focal: float = 585.0
    disparity_step: float = 2.85e-3
    baseline: float = 0.075
    grazing: tuple[float, float] = (np.deg2rad(65.0), np.deg2rad(85.0))
    speckle: float = 0.002
    near: float = 0.35
    far: float = 5.0
    noise: float = 1.0

    def __post_init__(self) -> None:
        def require(name: str, fits: bool, expected: str) -> None:
            if not fits:
                raise InputError(
                    f"structured light: {name} is {getattr(self, name)!r}; expected {expected}"
                )

        for name in ("disparity_step", "baseline", "near", "noise"):
            value = getattr(self, name)
            require(name, is_number(value) and 0 <= value < np.inf, "0 or more")
        focal = is_number(self.focal) and 0 < self.focal < np.inf
        require("focal", focal, "more than 0 pixels")
        speckle = is_number(self.speckle) and 0 <= self.speckle <= 1
        require("speckle", speckle, "a share, 0 to 1")
        far = is_number(self.far) and self.near < self.far
        require("far", far, f"more than near, {self.near}")
        require("grazing", _is_ramp(self.grazing), "two angles [rad], 0 or more, the second larger")


def is_number(value: Any) -> bool:
    """Whether it is a real number, of Python or NumPy."""
    return isinstance(value, Real)


def _is_ramp(value: Any) -> bool:
    if not isinstance(value, tuple | list) or len(value) != 2 or not all(map(is_number, value)):
        return False
    return 0 <= value[0] < value[1] < np.inf


KINECT = StructuredLight()


def axial_deviation(depth: Float[Array, "*s"], incidence: Float[Array, "*s"]) -> Float[Array, "*s"]:
    """Standard deviation of measured depth [m].

    Nguyen et al. 2012, equations 2 and 3: quadratic in depth, constant to 60 deg, hyperbolic above.

    Args:
      depth: [m].
      incidence: Angle between the surface's normal and the direction to the camera [rad].
    """
    xp = namespace(depth)
    deviation = 0.0012 + 0.0019 * (depth - 0.4) ** 2
    incidence = xp.minimum(incidence, _STEEPEST)
    steep = 1e-4 / xp.sqrt(xp.maximum(depth, 1e-3)) * (incidence / (np.pi / 2 - incidence)) ** 2
    return deviation + xp.where(incidence > np.deg2rad(60.0), steep, 0.0)


def lateral_deviation(incidence: Float[Array, "*s"]) -> Float[Array, "*s"]:
    """Standard deviation of where an edge appears [pixels of the source's focal length].

    Nguyen et al. 2012, equation 1; it does not depend on depth.

    Args:
      incidence: Angle between the surface's normal and the direction to the camera [rad].
    """
    incidence = namespace(incidence).minimum(incidence, _STEEPEST)
    return 0.8 + 0.035 * incidence / (np.pi / 2 - incidence)


def quantised(depth: Float[Array, "*s"], step: float) -> Float[Array, "*s"]:
    """Depth rounded to whole steps of its inverse [m]; 0 stays 0.

    Args:
      depth: [m].
      step: Of the inverse depth; 0: depth stays as it is [1/m].
    """
    if step == 0:
        return depth
    xp, seen = namespace(depth), depth > 0
    inverse = xp.rint(1.0 / xp.where(seen, depth, 1.0) / step) * step
    return xp.where(seen, 1.0 / xp.maximum(inverse, step), 0.0)


def projector_shadow(
    depth: Float[Array, "height width"], focal: float | Float[Array, ""], baseline: float
) -> Bool[Array, "height width"]:
    """Where the camera sees a surface that the projector does not reach.

    A projector at `baseline` along x sees a pixel at its column minus `focal * baseline / depth`;
    a nearer surface to the right of the pixel may lie there too, or further left.

    Args:
      depth: 0 where nothing is [m].
      focal: [pixels].
      baseline: [m].
    """
    xp, seen = namespace(depth), depth > 0
    column = xp.arange(depth.shape[1]) - focal * baseline / xp.where(seen, depth, 1.0)
    column = xp.where(seen, column, np.inf)
    # The least column among the pixels to the right.
    if xp is np:
        right = np.minimum.accumulate(column[:, ::-1], axis=1)[:, ::-1]
    else:
        from jax.lax import cummin

        right = cummin(column, axis=1, reverse=True)
    nearest = xp.concatenate([right[:, 1:], xp.full((len(depth), 1), np.inf)], axis=1)
    return seen & (nearest < column - 0.5)


@dataclass(frozen=True)
class Measured:
    """A depth image as a sensor reports it.

    Attributes:
      depth: [m]; 0 where it fails.
      rows, columns: Of the pixel that each pixel shows: its own, or, beyond an edge, one nearby.
    """

    depth: Float[Array, "height width"]
    rows: Int[Array, "height width"]
    columns: Int[Array, "height width"]

    def moved(self, image: Array) -> Array:
        """Another image of the same view, its edges where this sensor sees them."""
        return image[self.rows, self.columns]


@dataclass(frozen=True)
class Draws:
    """What is drawn for an image: shift `(2, height, width)` and noise, normal; fate, uniform in [0, 1)."""

    shift: Float[Array, "2 height width"]
    noise: Float[Array, "height width"]
    fate: Float[Array, "height width"]


def measure(
    depth: Float[np.ndarray, "height width"],
    cosine: Float[np.ndarray, "height width"],
    intrinsics: Intrinsics,
    rng: np.random.Generator,
    sensor: StructuredLight = KINECT,
) -> Measured:
    """The depth image as the sensor reports it, and which pixels its edges show; arguments as of `measure_with`.

    Args:
      depth: Exact, along the optical axis; 0 where nothing is [m].
      cosine: Of the angle of incidence.
      intrinsics: Of the image.
      rng: Draws the noise.
      sensor: The sensor's figures.
    """
    shape = depth.shape
    draws = Draws(rng.standard_normal((2, *shape)), rng.standard_normal(shape), rng.random(shape))
    return measure_with(depth, cosine, intrinsics.fx, draws, sensor)


def measure_with(
    depth: Float[Array, "height width"],
    cosine: Float[Array, "height width"],
    focal: float | Float[Array, ""],
    draws: Draws,
    sensor: StructuredLight = KINECT,
) -> Measured:
    """The depth image as the sensor reports it, and which pixels its edges show.

    Edges move by the lateral noise, depth by the axial noise and to the sensor's steps; pixels fail
    in the projector's shadow, at grazing incidence, out of range and, a few, anywhere.

    Args:
      depth: Exact, along the optical axis; 0 where nothing is [m].
      cosine: Of the angle of incidence.
      focal: Of the image, along x [pixels].
      draws: The noise.
      sensor: The sensor's figures.
    """
    xp = namespace(depth)
    shadow = projector_shadow(depth, focal, sensor.baseline)
    incidence = xp.arccos(xp.clip(xp.where(depth > 0, cosine, 1.0), 0.0, 1.0))
    lit = xp.where(shadow, 0.0, depth)
    source_focal = sensor.focal / sensor.noise if sensor.noise else np.inf  # no edge moves
    rows, columns = _edges_moved(lit, incidence, focal, source_focal, draws.shift)
    depth, incidence = lit[rows, columns], incidence[rows, columns]
    step = sensor.disparity_step * depth**2
    # What the sources measured includes the steps, whose variance is a twelfth of their square.
    variance = (sensor.noise * axial_deviation(depth, incidence)) ** 2 - step**2 / 12
    noisy = depth + draws.noise * xp.sqrt(xp.maximum(variance, 0.0))
    first, last = sensor.grazing
    failing = xp.clip((incidence - first) / (last - first), 0.0, 1.0) + sensor.speckle
    kept = (depth > 0) & (noisy > sensor.near) & (noisy < sensor.far)
    kept &= draws.fate >= failing
    steps = quantised(xp.where(kept, noisy, 0.0), sensor.disparity_step)
    return Measured(steps, rows, columns)


def structured_light(
    depth: Float[np.ndarray, "height width"],
    cosine: Float[np.ndarray, "height width"],
    intrinsics: Intrinsics,
    rng: np.random.Generator,
    sensor: StructuredLight = KINECT,
) -> Float[np.ndarray, "height width"]:
    """The depth alone of `measure`."""
    return measure(depth, cosine, intrinsics, rng, sensor).depth


def _edges_moved(
    depth: Float[Array, "height width"],
    incidence: Float[Array, "height width"],
    focal: float | Float[Array, ""],
    source_focal: float,
    drawn: Float[Array, "2 height width"],
) -> tuple[Int[Array, "height width"], Int[Array, "height width"]]:
    """Row and column of a pixel nearby where that lies beyond an edge, else of the pixel itself."""
    xp, (height, width) = namespace(depth), depth.shape
    deviation = lateral_deviation(incidence) * (focal / source_focal)
    shift = drawn * deviation
    row, column = xp.indices(depth.shape)
    rows = xp.clip(xp.rint(row + shift[0]), 0, height - 1).astype(row.dtype)
    columns = xp.clip(xp.rint(column + shift[1]), 0, width - 1).astype(row.dtype)
    there = depth[rows, columns]
    # On one surface depth changes by the way times the slope; more is an edge.
    way = xp.hypot(shift[0], shift[1]) * xp.maximum(depth, there) / focal
    slope = xp.tan(xp.minimum(incidence, np.deg2rad(80.0)))
    edge = (depth == 0) | (there == 0) | (xp.abs(there - depth) > _EDGE + 2 * way * slope)
    return xp.where(edge, rows, row), xp.where(edge, columns, column)
