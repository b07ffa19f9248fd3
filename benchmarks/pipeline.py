"""Build the YCB scans with our pipeline and with obj2mjcf, side by side: objects a minute, fidelity.

    pip install -e ".[bench]"
    python benchmarks/pipeline.py FOLDER_OF_YCB_ARCHIVES [--only NAME ...] [--jobs 2] [--json FILE]

Both start from the same textured OBJ files with empty caches and may use the same cores: ours as
`--jobs` processes, obj2mjcf's CoACD as many threads. They take turns, some objects at a time, so that a
busy machine slows both; rows and totals are printed as they come. Ours does more in its time: labels, mass, stable
poses, grasps tried in simulation. Fidelity compares the union of the convex parts, exactly (booleans
of manifold3d), with the scan as a closed solid: volume intersection over union, and the two-sided
Hausdorff distance, sampled (the greatest distance of a point of either outer surface from the other).
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

import manifold3d
import mujoco
import numpy as np
import trimesh
from scipy.spatial import cKDTree

from asset_pipeline.build.data_set import build
from asset_pipeline.geometry.repair import closed, weld
from asset_pipeline.sources import ycb
from manipose_mj.evaluation.statistics import machine
from manipose_mj.storage.cache_root import CACHE_VARIABLE

POINTS = 200_000  # on each surface: about 0.5 mm apart


@dataclass(frozen=True)
class Fidelity:
    """Of a union of convex parts.

    Attributes: parts; most_vertices of one part; iou with the scan's solid, NaN where the scan
    cannot be closed; hausdorff, two-sided [m].
    """

    parts: int
    most_vertices: int
    iou: float
    hausdorff: float


def main() -> None:
    """Build with both, print a row for each object and the totals."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("archives", type=Path, help="folder of YCB archives")
    parser.add_argument("--only", nargs="+", default=[], help="only these objects")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--json", type=Path, help="write the figures there as well")
    arguments = parser.parse_args()
    items = [
        i for i in ycb.items(arguments.archives) if not arguments.only or i.name in arguments.only
    ]
    print(
        f"{machine()}; {arguments.jobs} jobs; obj2mjcf {version('obj2mjcf')}, "
        f"coacd {version('coacd')}, mujoco {mujoco.__version__}"
    )
    _print_head()
    turn = 2 * arguments.jobs  # objects
    rows: dict[str, tuple[Fidelity, Fidelity]] = {}
    seconds = np.zeros(2)
    with tempfile.TemporaryDirectory(prefix="pipeline-") as scratch:
        os.environ[CACHE_VARIABLE] = f"{scratch}/cache"
        for first in range(0, len(items), turn):
            root = Path(scratch) / str(first)
            scans = {}
            for item in items[first : first + turn]:
                with ycb.opened(item) as scan:
                    scans[item.name] = scan.mesh
                    _stage_for_obj2mjcf(item.name, scan.texture, root / "theirs")
            ours, our_seconds = _build_ours(arguments.archives, list(scans), root, arguments.jobs)
            theirs, their_seconds = _build_theirs(list(scans), root / "theirs")
            seconds += our_seconds, their_seconds
            for name, mesh in scans.items():
                rows[name] = measure(mesh, ours[name]), measure(mesh, theirs[name])
                print(f"{name:<28}" + "".join(_cells(f) for f in rows[name]))
            _print_totals(rows, seconds)
            if arguments.json:
                _write(arguments.json, rows, seconds)


def measure(scan: trimesh.Trimesh, parts: list[trimesh.Trimesh]) -> Fidelity:
    """Compare convex parts with the scan."""
    union = manifold3d.Manifold.batch_boolean([_solid(p) for p in parts], manifold3d.OpType.Add)
    data = union.to_mesh64()
    shells = trimesh.Trimesh(data.vert_properties[:, :3], data.tri_verts, process=False).split(
        only_watertight=False
    )
    # Gaps between parts that nothing from outside can reach are no surface to touch.
    surface = trimesh.util.concatenate([s for s in shells if s.volume > 0])
    solid = closed(scan)
    iou = float("nan")
    if solid is not None:
        body = _solid(solid)
        both = (union ^ body).volume()
        iou = both / (union.volume() + body.volume() - both)
    a, b = (trimesh.sample.sample_surface(m, POINTS, seed=0)[0] for m in (weld(scan), surface))
    reach = max(cKDTree(a).query(b)[0].max(), cKDTree(b).query(a)[0].max())
    return Fidelity(len(parts), max(len(p.vertices) for p in parts), iou, float(reach))


def _solid(mesh: trimesh.Trimesh) -> manifold3d.Manifold:
    vertices = np.array(mesh.vertices, np.float64, order="C")
    faces = np.array(mesh.faces, np.uint64, order="C")
    return manifold3d.Manifold(manifold3d.Mesh64(vertices, faces))


def _stage_for_obj2mjcf(name: str, texture: Path | None, folder: Path) -> None:
    """Copy the OBJ and its texture under the object's name, with a material file that it accepts."""
    assert texture is not None
    folder.mkdir(parents=True, exist_ok=True)
    lines = (texture.parent / "textured.obj").read_text().splitlines()
    materials = sorted({line.split()[1] for line in lines if line.startswith("usemtl ")})
    shutil.copyfile(texture, folder / f"{name}.png")
    (folder / f"{name}.mtl").write_text(
        "".join(f"newmtl {m}\nKd 1 1 1\nmap_Kd {name}.png\n" for m in materials)
    )
    lines = [f"mtllib {name}.mtl" if line.startswith("mtllib ") else line for line in lines]
    (folder / f"{name}.obj").write_text("\n".join(lines) + "\n")


def _build_ours(
    archives: Path, names: list[str], root: Path, jobs: int
) -> tuple[dict[str, list[trimesh.Trimesh]], float]:
    start = time.perf_counter()
    results = build("ycb", archives, root / "ours", jobs=jobs, only=names)
    seconds = time.perf_counter() - start
    failed = [f"{r.name}: {r.reason}" for r in results if r.status != "built"]
    if failed:
        sys.exit("\n".join(failed))
    return {
        r.name: _parts(sorted((r.folder / "meshes").glob("*_collision_*"))) for r in results
    }, seconds


def _build_theirs(names: list[str], folder: Path) -> tuple[dict[str, list[trimesh.Trimesh]], float]:
    command = ["obj2mjcf", "--obj-dir", str(folder), "--decompose", "--save-mjcf", "--overwrite"]
    start = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    seconds = time.perf_counter() - start
    found = {n: _parts(sorted((folder / n).glob(f"{n}_collision_*.obj"))) for n in names}
    missing = [n for n, parts in found.items() if not parts]
    if done.returncode or missing:
        sys.exit(f"obj2mjcf failed on {missing}:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return found, seconds


def _parts(paths: list[Path]) -> list[trimesh.Trimesh]:
    return [trimesh.load(p, force="mesh", process=False).convex_hull for p in paths if _is_part(p)]


def _is_part(path: Path) -> bool:
    return path.suffix == ".obj" and re.search(r"_collision_\d+$", path.stem) is not None


def _print_head() -> None:
    print(
        f"{'object':<28}"
        + "".join(
            f"{who:>10} parts{'vertices':>9}{'IoU':>7}{'Hausdorff mm':>14}"
            for who in ("ours", "obj2mjcf")
        )
    )


def _print_totals(rows: dict[str, tuple[Fidelity, Fidelity]], seconds: np.ndarray) -> None:
    columns = np.array([[[f.iou, 1e3 * f.hausdorff] for f in pair] for pair in rows.values()])
    mean, median = np.nanmean(columns, axis=0), np.nanmedian(columns, axis=0)
    print(f"after {len(rows)} objects:")
    for label, values in (("mean", mean), ("median", median)):
        print(
            f"{label}: IoU ours {values[0, 0]:.3f}, obj2mjcf {values[1, 0]:.3f}; "
            f"Hausdorff ours {values[0, 1]:.2f} mm, obj2mjcf {values[1, 1]:.2f} mm"
        )
    rate = 60 * len(rows) / seconds
    print(
        f"ours {seconds[0]:.0f} s, {rate[0]:.2f} objects/min; "
        f"obj2mjcf {seconds[1]:.0f} s, {rate[1]:.2f} objects/min; ratio {rate[0] / rate[1]:.1f}",
        flush=True,
    )


def _write(path: Path, rows: dict[str, tuple[Fidelity, Fidelity]], seconds: np.ndarray) -> None:
    document = {
        "seconds": {"ours": seconds[0], "obj2mjcf": seconds[1]},
        "objects": {n: {"ours": asdict(a), "obj2mjcf": asdict(b)} for n, (a, b) in rows.items()},
    }
    path.write_text(json.dumps(document, indent=1) + "\n")


def _cells(f: Fidelity) -> str:
    return f"{f.parts:>16}{f.most_vertices:>9}{f.iou:>7.3f}{1e3 * f.hausdorff:>14.2f}"


if __name__ == "__main__":
    main()
