"""Surface normals from a noisy depth image, as a robot has to get them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from manipose_mj.mjcf.cameras.ray_camera import Intrinsics
from manipose_mj.poses import Array, namespace

RADIUS = 0.006  # half the window's side, on the surface [m]
MAX_RADIUS_PX = 6
GATE = 1.5  # change of depth, in half window sides, beyond which a neighbour is another surface
SOFT = 0.003  # residual from which a neighbour counts half in the second fit [m]
_RIDGE = 0.02  # pull towards the camera, in pixels' worth of slope, for pixels in a line


def depth_normals(
    depth: Float[np.ndarray, "height width"],
    mask: Bool[np.ndarray, "height width"],
    pixels: Int[np.ndarray, "n 2"],
    intrinsics: Intrinsics,
) -> Float[np.ndarray, "n 3"]:
    """Unit normals towards the camera, in the camera frame.

    A plane has an inverse depth that is linear in the image, `1 / z = a x/z + b y/z + c` with the
    normal along `(a, b, c)`; it is fitted to the pixels of a window around each pixel, twice: the
    second time with those that lie off the first plane weighted down (Welsch's weights).

    Args:
      depth: [m].
      mask: The object's pixels; others, and those with depth 0, are not used.
      pixels: `(row, column)` of those whose normals are wanted.
      intrinsics: Of the image.
    """
    usable = mask & (depth > 0)
    if not len(pixels):
        return np.zeros((0, 3))
    middle = float(np.median(depth[pixels[:, 0], pixels[:, 1]]))
    reach = int(np.clip(np.rint(RADIUS * intrinsics.fx / middle), 1, MAX_RADIUS_PX))
    padded = np.pad(np.where(usable, depth, 0.0).astype(np.float32), reach)
    side = np.arange(-reach, reach + 1)
    rows, columns = (g.ravel() for g in np.meshgrid(side, side, indexing="ij"))
    near = padded[pixels[:, :1] + reach + rows, pixels[:, 1:] + reach + columns]  # (n, window)
    own = depth[pixels[:, 0], pixels[:, 1]].astype(np.float32)[:, None]
    gate = GATE * max(RADIUS, reach * middle / intrinsics.fx)
    weight = ((near > 0) & (np.abs(near - own) < gate)).astype(np.float32)
    relative = own / np.where(near > 0, near, own)  # inverse depth, in units of the pixel's own
    # Abscissae in pixels keep the normal equations well scaled.
    at = np.stack([columns, rows, np.ones_like(rows)], axis=-1).astype(np.float32)
    plane = fit_planes(at, relative, weight)
    left = (relative - plane @ at.T) * (own / SOFT)
    plane = fit_planes(at, relative, weight * np.exp2(-left * left)).astype(float)
    a, b = plane[:, 0] * intrinsics.fx, plane[:, 1] * intrinsics.fy
    x = (pixels[:, 1] - intrinsics.cx) / intrinsics.fx
    y = (pixels[:, 0] - intrinsics.cy) / intrinsics.fy
    # 1 / z > 0 along the pixel's ray: the fitted vector points away from the camera.
    normal = -np.stack([a, b, plane[:, 2] - a * x - b * y], axis=-1)
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def fit_planes(
    at: Float[Array, "w 3"],
    values: Float[Array, "*n w"],
    weight: Float[Array, "*n w"],
) -> Float[Array, "*n 3"]:
    """Weighted least squares of `values = a x + b y + c`, each row by itself; `at` is `(x, y, 1)`."""
    xp = namespace(values)
    x, y, _ = at.T
    sums = weight @ xp.stack([x * x, x * y, y * y, x, y, x * 0 + 1], axis=-1)
    xx, xy, yy, sx, sy, total = xp.moveaxis(sums, -1, 0)
    vx, vy, v = xp.moveaxis((weight * values) @ at, -1, 0)
    total = xp.maximum(total, 1e-9)
    # About the weighted mean the constant drops out, and two unknowns are left.
    mx, my, mv = sx / total, sy / total, v / total
    cxx, cyy = xx / total - mx * mx + _RIDGE, yy / total - my * my + _RIDGE
    cxy = xy / total - mx * my
    cxv, cyv = vx / total - mx * mv, vy / total - my * mv
    determinant = cxx * cyy - cxy * cxy
    a = (cyy * cxv - cxy * cyv) / determinant
    b = (cxx * cyv - cxy * cxv) / determinant
    return xp.stack([a, b, mv - a * mx - b * my], axis=-1)
