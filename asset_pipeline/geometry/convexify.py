"""Convex collision parts of a scanned mesh: CoACD with settings chosen per mesh, cached."""

from __future__ import annotations

import hashlib
import logging
import tempfile
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

import coacd
import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import cKDTree

from asset_pipeline.geometry.hull_reduction import hull_parts, reduced_hull
from asset_pipeline.geometry.repair import closed, weld
from asset_pipeline.geometry.surface_points import surface_points
from manipose_mj.assets.geometry import Shape
from manipose_mj.errors import InputError
from manipose_mj.storage.cache_root import cache_root

log = logging.getLogger(__name__)

# Parts thinner or smaller than this take no part in any contact [m^3].
MIN_PART_VOLUME = 1e-9


@dataclass(frozen=True)
class ConvexSettings:
    """How closely the parts follow the scan, and at what price.

    Attributes:
      concavity: CoACD's threshold: how deep a hollow a part may bridge [m].
      concavity_share: The same as a share of the longest extent; the larger counts.
      max_parts: Parts are merged, cheapest first, until there are no more than this.
      shell_parts: The same for thin-walled vessels, which must stay hollow.
      shell: Filling no more than this share of its hull, an object is one of those.
      max_vertices: Of one part.
      convex_enough: With at least this share of its hull's volume an object is its hull, unless
      hollow: somewhere its surface and the hull's are farther apart than this [m], as at a handle,
        a hole or a well of small volume, or
      hollow_share: than this share of the longest extent; the larger counts.
      hull_tolerance: How far a corner of that hull may lie outside the parts it is cut into [m].
      simplification: How far the surface may move before CoACD sees it [m]; time falls with the
        number of faces, and a scan's 16,000 say little that 2,000 do not.
      iterations: Of CoACD's tree search for each cut.
    """

    concavity: float = 0.003
    concavity_share: float = 0.02
    max_parts: int = 32
    shell_parts: int = 64
    shell: float = 0.2
    max_vertices: int = 32
    convex_enough: float = 0.92
    hollow: float = 0.010
    hollow_share: float = 0.05
    hull_tolerance: float = 0.001
    simplification: float = 0.0007
    iterations: int = 40


def convexify(
    mesh: trimesh.Trimesh, settings: ConvexSettings | None = None, *, cache: Path | None = None
) -> tuple[Shape, ...]:
    """Convex parts whose union stands for the mesh in contacts.

    A mesh that can be closed goes to CoACD as it is (`preprocess_mode="off"`); CoACD's voxel
    remeshing, which costs minutes and thickens thin walls, is for those that cannot. An object that
    is nearly its own convex hull, without handle, hole or well, becomes that hull, in a few slabs. CoACD's own reduction of the parts' vertices
    pulls their surfaces in by up to a centimetre; ours (`hull_reduction`) stays near 1 mm.

    Args:
      mesh: In the body frame [m].
      settings: None takes the defaults.
      cache: Folder of results keyed by mesh and settings; None takes `$MANIPOSE_CACHE`, or
        `~/.cache/manipose-mj`. Safe to share between processes; one that cannot be written is not
        used.

    Raises:
      InputError: The mesh spans no volume.
    """
    settings = settings or ConvexSettings()
    entry = (cache or cache_root()) / "convex" / f"{_key(mesh, settings)}.npz"
    parts = _read(entry)
    if parts is None:
        parts = _decompose(mesh, settings)
        _write(entry, parts)
    return tuple(Shape(kind="mesh", mesh=part) for part in parts)


@dataclass(frozen=True)
class Fidelity:
    """How parts differ from the scan's solid, each a one-sided Hausdorff distance [m], sampled.

    Attributes:
      gap: From the scan's surface to the parts: a touch that goes through.
      bulge: From the parts to the scan: a touch of nothing.
      bulge_95: Its 95th percentile over the parts' outside.
    """

    gap: float
    bulge: float
    bulge_95: float


def fidelity(mesh: trimesh.Trimesh, parts: tuple[Shape, ...], *, samples: int = 1500) -> Fidelity:
    """Compare parts with the solid that `mesh` bounds; deterministic.

    Args:
      mesh: The scan, closable (`repair.closed`); otherwise its inside counts as outside.
      parts: Convex mesh shapes in the frame of `mesh`.
      samples: Surface points on either side.
    """
    solid = closed(mesh) or weld(mesh)
    hulls = [part.surface() for part in parts]
    points = trimesh.sample.sample_surface(solid, samples, seed=0)[0]
    outside = points[np.min([_depth(h, points) for h in hulls], axis=0) > 0]
    gaps = (
        [trimesh.proximity.closest_point(h, outside)[1] for h in hulls] if len(outside) else [[0]]
    )
    area = sum(h.area for h in hulls)
    touching = np.concatenate(
        [
            trimesh.sample.sample_surface(h, 20 + int(samples * h.area / area), seed=0)[0]
            for h in hulls
        ]
    )
    touching = touching[np.min([_depth(h, touching) for h in hulls], axis=0) > -1e-4]
    if solid.is_watertight:
        touching = touching[~solid.contains(touching)]
    bulges = trimesh.proximity.closest_point(solid, touching)[1] if len(touching) else [0.0]
    return Fidelity(
        gap=float(np.min(gaps, axis=0).max()),
        bulge=float(np.max(bulges)),
        bulge_95=float(np.percentile(bulges, 95)),
    )


def _depth(hull: trimesh.Trimesh, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
    """Greatest signed distance to a face plane: negative inside [m]."""
    offsets = np.einsum("fi,fi->f", hull.face_normals, hull.triangles[:, 0])
    return (points @ hull.face_normals.T - offsets).max(axis=1)


def _decompose(mesh: trimesh.Trimesh, settings: ConvexSettings) -> list[trimesh.Trimesh]:
    solid = closed(mesh)
    try:
        whole = mesh.convex_hull
        if whole.volume < MIN_PART_VOLUME:
            raise ValueError("no volume")
    except Exception:  # qhull's own type, for flat input
        raise InputError("mesh spans no volume; expected a solid object") from None
    if solid is not None and _nearly_convex(solid, whole, settings):
        return hull_parts(
            np.asarray(whole.vertices), settings.max_vertices, tolerance=settings.hull_tolerance
        )
    thin = solid is not None and solid.volume <= settings.shell * whole.volume
    source = closed(mesh, settings.simplification) or weld(mesh)
    coacd.set_log_level("error")
    pieces = coacd.run_coacd(
        coacd.Mesh(np.asarray(source.vertices), np.asarray(source.faces)),
        threshold=max(settings.concavity, settings.concavity_share * float(max(source.extents))),
        real_metric=True,
        max_convex_hull=settings.shell_parts if thin else settings.max_parts,
        preprocess_mode="off" if source.is_watertight else "on",
        mcts_iterations=settings.iterations,
        resolution=1000,
        seed=0,
    )
    hulls = [np.asarray(vertices) for vertices, _ in pieces]
    parts = [reduced_hull(h, settings.max_vertices) for h in hulls if _volume(h) > MIN_PART_VOLUME]
    log.info("%d faces -> %d convex parts", len(source.faces), len(parts))
    return parts


def _nearly_convex(solid: trimesh.Trimesh, hull: trimesh.Trimesh, settings: ConvexSettings) -> bool:
    """Whether the hull fills in neither much volume nor any deep hollow.

    The solid's surface is deep below the hull in a well; the hull's is far from the solid over a wide hole in a plate.
    """
    if solid.volume < settings.convex_enough * hull.volume:
        return False
    allowed = max(settings.hollow, settings.hollow_share * float(max(hull.extents)))
    spacing = allowed / 4
    own, outer = surface_points(solid, spacing), surface_points(hull, spacing)
    # The nearest of the points lies farther off than the nearest of the surface, by up to half a spacing's diagonal.
    reach = allowed + 0.7 * spacing
    depths, _ = cKDTree(outer).query(own, distance_upper_bound=reach)
    gaps, _ = cKDTree(own).query(outer, distance_upper_bound=reach)
    return bool(np.isfinite(depths).all() and np.isfinite(gaps).all())


def _volume(points: Float[np.ndarray, "n 3"]) -> float:
    try:
        return float(trimesh.convex.convex_hull(points).volume)
    except Exception:  # qhull's own type: a sliver
        return 0.0


def _key(mesh: trimesh.Trimesh, settings: ConvexSettings) -> str:
    digest = hashlib.sha256()
    digest.update(np.ascontiguousarray(mesh.vertices, dtype="<f8").tobytes())
    digest.update(np.ascontiguousarray(mesh.faces, dtype="<i8").tobytes())
    digest.update(repr(sorted(asdict(settings).items())).encode())
    digest.update(f"coacd {version('coacd')}, reduction 3".encode())
    return digest.hexdigest()


def _read(entry: Path) -> list[trimesh.Trimesh] | None:
    try:
        with np.load(entry, allow_pickle=False) as stored:
            count = len(stored.files) // 2
            return [
                trimesh.Trimesh(stored[f"vertices_{i}"], stored[f"faces_{i}"], process=False)
                for i in range(count)
            ] or None
    except FileNotFoundError:
        return None
    except Exception as error:  # a damaged entry is only a miss
        log.warning("%s: unreadable cache entry (%s); computing it again", entry, error)
        return None


def _write(entry: Path, parts: list[trimesh.Trimesh]) -> None:
    arrays = {f"vertices_{i}": np.asarray(p.vertices) for i, p in enumerate(parts)}
    arrays |= {f"faces_{i}": np.asarray(p.faces) for i, p in enumerate(parts)}
    staging = None
    try:
        entry.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=entry.parent, suffix=".part", delete=False) as file:
            staging = Path(file.name)
            np.savez_compressed(file, allow_pickle=False, **arrays)
        staging.replace(entry)  # atomic: another process sees all of it or nothing
    except OSError as error:
        log.warning("%s: cannot be written (%s); continuing without cache", entry, error)
        if staging is not None:
            staging.unlink(missing_ok=True)
