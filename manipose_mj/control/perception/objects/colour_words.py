"""Words for the colours of an object: of the pixels that show it, or of its surface."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from scipy.ndimage import binary_erosion

from manipose_mj.control.perception.objects.object_views import ObjectView
from manipose_mj.errors import InputError
from manipose_mj.mjcf.cameras.ray_casting import visible_geoms
from manipose_mj.mjcf.cameras.surface_colours import SurfaceColours, to_display

LEAST_PIXELS = 40  # that a word is made of
_SAMPLES = 2000  # of a surface
# Saturation and brightness from which on a pixel has a hue; brightness is that of the brightest channel.
_SATURATED, _DIM = 0.28, 0.22
_BLACK, _WHITE = 0.36, 0.55  # brightness of black in full light, and of white in the shade
_PLAIN_WHITE = 0.8  # brightness of a white surface by itself
_ORANGE = 0.62  # brightness from which on brown is orange
_PINK = (0.62, 0.55)  # brightness from which on red is pink, and saturation up to which it is
# Hues in degrees, up to which a colour goes.
_HUES = ((14, "red"), (42, "orange"), (68, "yellow"), (165, "green"), (255, "blue"), (300, "purple"), (340, "pink"), (361, "red"))  # fmt: skip
_SHADES = (("white", "grey"), ("orange", "brown"))  # lit and in the shade
_LIT = 0.35  # share of the lit one, of both, from which on all is
_SECOND = 0.3  # share of a second colour that is told
_FIRST = 0.35  # and of the first, where there is one


def colour_words(pixels: UInt8[np.ndarray, "n 3"], white: float = _WHITE) -> str:
    """Such as `red`, or `red and white`: the colours that most pixels have, whatever light and shade do to them.

    Args:
      pixels: As displayed.
      white: Brightness from which on what has no hue is white, in 0..1.

    Returns:
      Of black, white, grey, brown, red, orange, yellow, green, blue, purple and pink, one or two; `many-coloured` where none
      prevails; empty of fewer than `LEAST_PIXELS`.
    """
    if len(pixels) < LEAST_PIXELS:
        return ""
    names = _names(pixels.astype(float) / 255, white)
    shares = {str(name): float((names == name).mean()) for name in np.unique(names)}
    for lit, shaded in _SHADES:
        both = shares.pop(lit, 0.0), shares.pop(shaded, 0.0)
        shares[lit if both[0] >= _LIT * sum(both) else shaded] = sum(both)
    ordered = sorted(shares, key=lambda name: (-shares[name], name))
    if shares[ordered[0]] < _FIRST:
        return "many-coloured"
    return " and ".join(name for i, name in enumerate(ordered[:2]) if not i or shares[name] >= _SECOND)  # fmt: skip


def _names(colours: Float[np.ndarray, "n 3"], white: float) -> np.ndarray:
    """The name of each colour."""
    most, least = colours.max(axis=1), colours.min(axis=1)
    spread = most - least
    saturation = spread / np.maximum(most, 1e-6)
    red, green, blue = colours.T
    safe = np.maximum(spread, 1e-6)
    hue = 60 * np.select(
        [most == red, most == green],
        [((green - blue) / safe) % 6, (blue - red) / safe + 2],
        (red - green) / safe + 4,
    )
    edges = [edge for edge, _ in _HUES]
    names = np.array([name for _, name in _HUES], dtype=object)[
        np.searchsorted(edges, hue, "right")
    ]
    names[(names == "orange") & (most < _ORANGE)] = "brown"
    names[(names == "red") & (most > _PINK[0]) & (saturation < _PINK[1])] = "pink"
    plain = (saturation < _SATURATED) | (most < _DIM)
    names[plain] = np.select([most < _BLACK, most < white], ["black", "grey"], "white")[plain]
    return names.astype(str)


class SeenColours:
    """Words for objects by the camera that shows most of each, once an episode."""

    def __init__(self, views: Callable[[str], Sequence[ObjectView]]) -> None:
        """Looks at nothing yet; `views` are those of an object now."""
        self._views = views
        self._known: dict[str, str] = {}

    def forget(self) -> None:
        """An episode begins."""
        self._known = {}

    def of(self, name: str) -> str:
        """Words for an object; empty where too little of it shows, or nothing renders colours."""
        if not self._known.get(name):
            self._known[name] = self._seen(name)
        return self._known[name]

    def _seen(self, name: str) -> str:
        views = self._views(name)
        if not views:
            return ""
        image = max((view.image for view in views), key=lambda each: int(each.mask.sum()))
        inner = binary_erosion(image.mask)  # pixels of an edge have a share of what is behind
        mask = inner if inner.sum() >= LEAST_PIXELS else image.mask
        try:
            return colour_words(image.rgb()[mask])
        except (InputError, KeyError):
            return ""


def surface_colour_words(model: mujoco.MjModel, geoms: Bool[np.ndarray, "ngeom"]) -> str:
    """Words for the visible ones of these geoms, by the colours all over them.

    Args:
      model: That they are of, with its textures.
      geoms: Of one object.
    """
    shown = np.flatnonzero(geoms & visible_geoms(model))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    rng = np.random.default_rng(0)
    surfaces = [_surface(model, int(geom), rng) for geom in shown]
    areas = np.array([area for area, _ in surfaces])
    counts = np.ceil(_SAMPLES * areas / max(areas.sum(), 1e-12)).astype(int)
    points, ids = [], []
    for geom, (_, local), count in zip(shown, surfaces, counts, strict=True):
        turned = local[:count] @ data.geom_xmat[geom].reshape(3, 3).T
        points.append(turned + data.geom_xpos[geom])
        ids.append(np.full(len(turned), geom))
    if not points:
        return ""
    linear = SurfaceColours(model).at(data, np.concatenate(points), np.concatenate(ids))
    return colour_words(np.round(255 * to_display(linear)).astype(np.uint8), _PLAIN_WHITE)


def _surface(
    model: mujoco.MjModel, geom: int, rng: np.random.Generator
) -> tuple[float, Float[np.ndarray, "n 3"]]:
    """Area of a geom [m^2] and points all over it in its frame [m]; of what is no mesh, its middle over and over."""
    mesh = int(model.geom_dataid[geom])
    if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
        return float(model.geom_rbound[geom]) ** 2, np.zeros((_SAMPLES, 3))
    vertices = _rows(model.mesh_vert, model.mesh_vertadr[mesh], model.mesh_vertnum[mesh])
    faces = _rows(model.mesh_face, model.mesh_faceadr[mesh], model.mesh_facenum[mesh])
    a, b, c = vertices[faces].astype(float).transpose(1, 0, 2)
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    chosen = rng.choice(len(faces), _SAMPLES, p=doubled / doubled.sum())
    u, v = rng.random((2, _SAMPLES, 1))
    folded = u + v > 1
    u, v = np.where(folded, 1 - u, u), np.where(folded, 1 - v, v)
    a, b, c = a[chosen], b[chosen], c[chosen]
    return float(doubled.sum()) / 2, a + u * (b - a) + v * (c - a)


def _rows(values: np.ndarray, start: int, count: int) -> Int[np.ndarray, "n m"] | np.ndarray:
    return values[start : start + count]
