"""Handles and joints estimated from clouds of furniture, against the bars they are to be within.

    python benchmarks/articulated_table.py --assets DIR --json FILE --pictures DIR

The catalogue's test furniture, and built assets such as PartNet-Mobility's, never trained on: one view from
before the front, and three fused. Shares are of the parts whose handle shows. The network alone, and with the fit of furniture.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import jax
import numpy as np
from jaxtyping import PRNGKeyArray

from manipose_mj.console.process import CORES, one_thread_per_process

one_thread_per_process()

from pose_tables.options import check_files, check_folder, write_rows  # noqa: E402

from manipose_mj.control.furniture.furniture_estimator import FurnitureEstimator  # noqa: E402
from manipose_mj.errors import InputError  # noqa: E402
from manipose_mj.ppf_jax.articulated_estimator import ArticulatedEstimator, PartEstimate  # noqa: E402
from manipose_mj.ppf_jax.data.articulated.assets import asset_scenes  # noqa: E402
from manipose_mj.ppf_jax.data.articulated.cache import furniture_names, furniture_scenes  # noqa: E402
from manipose_mj.ppf_jax.data.articulated.clouds import (  # noqa: E402
    FurnitureCloud,
    FurnitureScene,
    handle_poses,
)
from manipose_mj.ppf_jax.evaluation.part_evaluation import PartFinder, evaluated, scene_clouds  # noqa: E402
from manipose_mj.ppf_jax.evaluation.part_metrics import PartErrors, part_errors, summary  # noqa: E402

_WORST = 10


def main(argv: Sequence[str] | None = None) -> int:
    """Print the rows; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--weights", type=Path, help="of the package without it")
    parser.add_argument("--assets", type=Path, help="folder of built articulated assets")
    parser.add_argument("--scenes", type=int, default=8, help="of each object")
    parser.add_argument("--fused", type=int, nargs="+", default=[1, 3], help="views in a cloud")
    parser.add_argument("--jobs", type=int, default=CORES)
    parser.add_argument("--json", type=Path, help="write the rows here")
    parser.add_argument("--pictures", type=Path, help="draw the worst views into this folder")
    options = parser.parse_args(argv)
    try:
        check_files(options.json)
        check_folder(options.pictures)
        _measure(options)
    except InputError as error:
        print(f"articulated_table: {error}", file=sys.stderr)
        return 2
    return 0


def _measure(options: argparse.Namespace) -> None:
    if options.weights is None:
        estimator = ArticulatedEstimator.load()
    else:
        estimator = ArticulatedEstimator.from_file(options.weights)
    finders = {"network": (estimator, 0.5), "fitted": (_Fitted(estimator), 0.1)}
    names = furniture_names("test")
    sets = {"catalogue": furniture_scenes(names, "front", scenes=options.scenes, jobs=options.jobs)}
    if options.assets is not None:
        sets["assets"] = asset_scenes(
            options.assets, "front", scenes=options.scenes, jobs=options.jobs
        )
    rows = []
    for which, scenes in sets.items():
        for fused in options.fused:
            for name, (finder, least) in finders.items():
                rows += _rows(name, finder, least, which, scenes, fused, options.pictures)
                if options.json is not None:
                    write_rows(options.json, rows)


class _Fitted:
    """The network and the fit, told the category of the furniture in each cloud."""

    def __init__(self, network: ArticulatedEstimator) -> None:
        self._whole = FurnitureEstimator(network)

    def estimate_many(
        self, clouds: Sequence[FurnitureCloud], *, key: PRNGKeyArray, least: float
    ) -> list[list[PartEstimate]]:
        """As of `PartFinder`."""
        categories = [cloud.scene.category for cloud in clouds]
        return self._whole.estimate_many(clouds, categories, key=key, least=least)


def _rows(
    name: str,
    estimator: PartFinder,
    least: float,
    which: str,
    scenes: Sequence[FurnitureScene],
    fused: int,
    pictures: Path | None,
) -> list[dict]:
    clouds = scene_clouds(scenes, fused=fused)
    begun = time.process_time()
    found = evaluated(estimator, clouds, least=least)
    spent = time.process_time() - begun
    owner = {scene.name: scene for scene in scenes}
    kinds = ["all", *dict.fromkeys(scene.category for scene in scenes)]
    rows = []
    for kind in kinds:
        own = [e for e in found.errors if kind in ("all", owner[e.name.split(" ")[0]].category)]
        if not own:
            continue
        row = {"objects": which, "views": fused, "by": name, "category": kind} | summary(own, 0, 1)
        del row["false_positives_per_cloud"]
        if kind == "all":
            row["false_positives_per_cloud"] = found.false_positives / found.clouds
            row["cpu_ms_per_cloud"] = 1e3 * spent / found.clouds
        rows.append(row)
        print(json.dumps({k: round(v, 3) if isinstance(v, float) else v for k, v in row.items()}))
    for e in sorted(found.errors, key=_badness)[-_WORST:]:
        print(
            f"  {e.name}: {100 * e.centre:.1f} cm, {np.degrees(e.axes):.1f} deg, "
            f"type {'right' if e.type_right else 'wrong'}, {np.degrees(e.direction):.1f} deg, "
            f"{100 * e.line:.1f} cm"
        )
    if pictures is not None:
        pictures.mkdir(parents=True, exist_ok=True)
        _draw(estimator, least, clouds, found.errors, pictures / f"{which}-{fused}-{name}.png")
    return rows


def _badness(errors: PartErrors) -> float:
    """How many bars an estimate misses, and by how much."""
    worst = max(errors.centre / 0.015, errors.axes / 0.087, errors.direction / 0.087)
    worst = max(worst, errors.line / 0.02)
    return worst if np.isfinite(worst) else 1e6


def _draw(
    estimator: PartFinder,
    least: float,
    clouds: Sequence[FurnitureCloud],
    errors: Sequence[PartErrors],
    path: Path,
) -> None:
    """The views in which most went wrong: true handles and joints black, estimated ones in colour."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    wrong: dict[str, int] = {}
    for e in errors:
        if not e.all_right:
            name = e.name.split(" ")[0]
            wrong[name] = wrong.get(name, 0) + 1
    chosen = sorted(wrong, key=lambda name: -wrong[name])[:8]
    figure, axes = plt.subplots(2, 4, figsize=(20, 10))
    for name, plot in zip(chosen, axes.ravel(), strict=False):
        cloud = next(c for c in clouds if c.scene.name == name)
        # As `evaluated` pads, any batch will do: an answer depends on the key and the cloud alone.
        found = estimator.estimate_many([cloud], key=jax.random.key(0), least=least)[0]
        few = slice(0, 5000)
        colour = np.where(cloud.handle, 2, np.minimum(cloud.part, 0) + 1)[few]
        flat = cloud.points[few, :2] / cloud.points[few, 2:]
        plot.scatter(flat[:, 0], -flat[:, 1], c=colour, s=1, cmap="Pastel2")
        own = part_errors(cloud, found)[0]
        for pose, joint in zip(handle_poses(cloud), cloud.scene.joints, strict=True):
            at = cloud.pose[:3, :3] @ joint.origin + cloud.pose[:3, 3]
            direction = cloud.pose[:3, :3] @ joint.axis
            _lines(plot, pose, at, direction, joint.hinge, ("k", "k", "k"))
        for part in found:
            colours = ("tab:red", "tab:green", "tab:cyan")
            hinge = part.joint == "hinge"
            _lines(plot, part.handle, part.axis_origin, part.axis, hinge, colours)
        right = sum(e.all_right for e in own)
        plot.set_title(f"{name}: {right} of {len(own)} right")
        plot.set_aspect("equal")
    figure.tight_layout()
    figure.savefig(path, dpi=60)
    plt.close(figure)


def _lines(plot, handle, origin, axis, hinge: bool, colours: tuple[str, str, str]) -> None:
    """X and Y of a handle, and the joint's axis."""
    centre = handle[:3, 3]
    ends = [centre + 0.06 * handle[:3, 0], centre + 0.06 * handle[:3, 1]]
    at = origin + ((centre - origin) @ axis) * axis if hinge else centre
    segments = [(centre, ends[0]), (centre, ends[1]), (at, at + 0.15 * axis)]
    for (start, end), colour in zip(segments, colours, strict=True):
        line = np.stack([start, end])
        if (line[:, 2] > 0.1).all():
            flat = line[:, :2] / line[:, 2:]
            plot.plot(flat[:, 0], -flat[:, 1], color=colour, linewidth=1.5)


if __name__ == "__main__":
    sys.exit(main())
