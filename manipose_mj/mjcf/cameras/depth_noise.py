"""What a structured-light camera makes of a depth image: pure functions of arrays.

Figures are the first Kinect's. Nguyen, Izadi, Lovell, "Modeling Kinect sensor noise for improved 3D
reconstruction and tracking" (3DIMPVT 2012): standard deviations of depth and of edges as functions of
depth and of the angle of incidence. Khoshelham, Elberink, "Accuracy and resolution of Kinect depth
data for indoor mapping applications" (Sensors 2012): the steps of depth and the baseline. Noise is
drawn for each pixel by itself; the real sensor's is smooth over a few pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.mjcf.cameras.ray_camera import Intrinsics

# The models' hyperbolas end at a right angle, the measurements they fit some degrees before.
_STEEPEST = np.deg2rad(85.0)
_EDGE = 0.01  # change of depth, beyond that of the surface's slope, that makes an edge [m]


@dataclass(frozen=True)
class StructuredLight:
    """A projector and a camera.

    Attributes:
      focal: Focal length to which pixels of the sources refer; noise keeps its angle in images
        of other sizes [pixels].
      disparity_step: Depth `z` is reported in steps of `disparity_step * z**2` [1/m].
      baseline: From the camera to the projector, along the camera's x [m].
      grazing: Angle of incidence from where pixels begin to fail, and where all have [rad]. The
        sources measured to some 80 deg; the ramp between is our assumption.
      speckle: Share of pixels that fail anywhere; our assumption.
      near, far: Limits of what is measured [m]; near as of PrimeSense's short-range model.
      noise: Factor of all standard deviations, for sensors better or worse than the sources'.
    """

    focal: float = 585.0
    disparity_step: float = 2.85e-3
    baseline: float = 0.075
    grazing: tuple[float, float] = (np.deg2rad(65.0), np.deg2rad(85.0))
    speckle: float = 0.002
    near: float = 0.35
    far: float = 5.0
    noise: float = 1.0


KINECT = StructuredLight()


def axial_deviation(
    depth: Float[np.ndarray, "*s"], incidence: Float[np.ndarray, "*s"]
) -> Float[np.ndarray, "*s"]:
    """Standard deviation of measured depth [m].

    Nguyen et al. 2012, equations 2 and 3: quadratic in depth, constant to 60 deg, hyperbolic above.

    Args:
      depth: [m].
      incidence: Angle between the surface's normal and the direction to the camera [rad].
    """
    deviation = 0.0012 + 0.0019 * (depth - 0.4) ** 2
    incidence = np.minimum(incidence, _STEEPEST)
    steep = 1e-4 / np.sqrt(np.maximum(depth, 1e-3)) * (incidence / (np.pi / 2 - incidence)) ** 2
    return deviation + np.where(incidence > np.deg2rad(60.0), steep, 0.0)


def lateral_deviation(incidence: Float[np.ndarray, "*s"]) -> Float[np.ndarray, "*s"]:
    """Standard deviation of where an edge appears [pixels of the source's focal length].

    Nguyen et al. 2012, equation 1; it does not depend on depth.

    Args:
      incidence: Angle between the surface's normal and the direction to the camera [rad].
    """
    incidence = np.minimum(incidence, _STEEPEST)
    return 0.8 + 0.035 * incidence / (np.pi / 2 - incidence)


def quantised(depth: Float[np.ndarray, "*s"], step: float) -> Float[np.ndarray, "*s"]:
    """Depth rounded to whole steps of its inverse [m]; 0 stays 0.

    Args:
      depth: [m].
      step: Of the inverse depth [1/m].
    """
    seen = depth > 0
    inverse = np.rint(1.0 / np.where(seen, depth, 1.0) / step) * step
    return np.where(seen, 1.0 / np.maximum(inverse, step), 0.0)


def projector_shadow(
    depth: Float[np.ndarray, "height width"], focal: float, baseline: float
) -> Bool[np.ndarray, "height width"]:
    """Where the camera sees a surface that the projector does not reach.

    A projector at `baseline` along x sees a pixel at its column minus `focal * baseline / depth`;
    a nearer surface to the right of the pixel may lie there too, or further left.

    Args:
      depth: 0 where nothing is [m].
      focal: [pixels].
      baseline: [m].
    """
    seen = depth > 0
    column = np.arange(depth.shape[1]) - focal * baseline / np.where(seen, depth, 1.0)
    column = np.where(seen, column, np.inf)
    # The least column among the pixels to the right.
    right = np.minimum.accumulate(column[:, ::-1], axis=1)[:, ::-1]
    nearest = np.concatenate([right[:, 1:], np.full((len(depth), 1), np.inf)], axis=1)
    return seen & (nearest < column - 0.5)


@dataclass(frozen=True)
class Measured:
    """A depth image as a sensor reports it.

    Attributes:
      depth: [m]; 0 where it fails.
      rows, columns: Of the pixel that each pixel shows: its own, or, beyond an edge, one nearby.
    """

    depth: Float[np.ndarray, "height width"]
    rows: Int[np.ndarray, "height width"]
    columns: Int[np.ndarray, "height width"]

    def moved(self, image: np.ndarray) -> np.ndarray:
        """Another image of the same view, its edges where this sensor sees them."""
        return image[self.rows, self.columns]


def measure(
    depth: Float[np.ndarray, "height width"],
    cosine: Float[np.ndarray, "height width"],
    intrinsics: Intrinsics,
    rng: np.random.Generator,
    sensor: StructuredLight = KINECT,
) -> Measured:
    """The depth image as the sensor reports it, and which pixels its edges show.

    Edges move by the lateral noise, depth by the axial noise and to the sensor's steps; pixels fail
    in the projector's shadow, at grazing incidence, out of range and, a few, anywhere.

    Args:
      depth: Exact, along the optical axis; 0 where nothing is [m].
      cosine: Of the angle of incidence.
      intrinsics: Of the image.
      rng: Draws the noise.
      sensor: The sensor's figures.
    """
    shadow = projector_shadow(depth, intrinsics.fx, sensor.baseline)
    incidence = np.arccos(np.clip(np.where(depth > 0, cosine, 1.0), 0.0, 1.0))
    lit = np.where(shadow, 0.0, depth)
    source_focal = sensor.focal / sensor.noise
    rows, columns = _edges_moved(lit, incidence, intrinsics.fx, source_focal, rng)
    depth, incidence = lit[rows, columns], incidence[rows, columns]
    step = sensor.disparity_step * depth**2
    # What the sources measured includes the steps, whose variance is a twelfth of their square.
    variance = (sensor.noise * axial_deviation(depth, incidence)) ** 2 - step**2 / 12
    noisy = depth + rng.standard_normal(depth.shape) * np.sqrt(np.maximum(variance, 0.0))
    first, last = sensor.grazing
    failing = np.clip((incidence - first) / (last - first), 0.0, 1.0) + sensor.speckle
    kept = (depth > 0) & (noisy > sensor.near) & (noisy < sensor.far)
    kept &= rng.random(depth.shape) >= failing
    steps = quantised(np.where(kept, noisy, 0.0), sensor.disparity_step)
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
    depth: Float[np.ndarray, "height width"],
    incidence: Float[np.ndarray, "height width"],
    focal: float,
    source_focal: float,
    rng: np.random.Generator,
) -> tuple[Int[np.ndarray, "height width"], Int[np.ndarray, "height width"]]:
    """Row and column of a pixel nearby where that lies beyond an edge, else of the pixel itself."""
    height, width = depth.shape
    deviation = lateral_deviation(incidence) * (focal / source_focal)
    shift = rng.standard_normal((2, height, width)) * deviation
    row, column = np.indices(depth.shape)
    rows = np.clip(np.rint(row + shift[0]), 0, height - 1).astype(np.int64)
    columns = np.clip(np.rint(column + shift[1]), 0, width - 1).astype(np.int64)
    there = depth[rows, columns]
    # On one surface depth changes by the way times the slope; more is an edge.
    way = np.hypot(*shift) * np.maximum(depth, there) / focal
    slope = np.tan(np.minimum(incidence, np.deg2rad(80.0)))
    edge = (depth == 0) | (there == 0) | (np.abs(there - depth) > _EDGE + 2 * way * slope)
    return np.where(edge, rows, row), np.where(edge, columns, column)
