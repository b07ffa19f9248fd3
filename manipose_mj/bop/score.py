"""Recalls of estimates over a BOP data set, by object type, symmetry and category.

An estimate is right at MSSD under a share of the object's diameter, 5 % to 50 % in steps of 5 %, and at MSPD under
5 to 50 pixels of an image 640 wide; the recalls are means over these thresholds, as BOP's. ADD(-S) counts under 10 %
of the diameter. A target without an estimate counts as missed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from manipose_mj.bop.dataset import BopData, Model, Target
from manipose_mj.bop.pose_distances import add, add_s, mspd, mssd
from manipose_mj.bop.results_csv import Estimate
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, pose_error

STEPS = np.arange(1, 11) * 0.05
WIDTH = 640  # of an image that thresholds in pixels refer to
ADD_SHARE = 0.1
BARS = ((5, 2), (10, 5))  # [deg, cm]


@dataclass(frozen=True)
class TargetErrors:
    """Of the estimate of one target; infinite where there is none.

    Attributes:
      mssd: Share of the diameter.
      mspd: [pixels] of an image 640 wide.
      add: ADD, or ADD-S of an object with symmetries, as a share of the diameter.
      origin: Between the models' origins, the least over the symmetries [m].
      rotation: The least over the symmetries [rad].
    """

    mssd: float
    mspd: float
    add: float
    origin: float
    rotation: float


MISSED = TargetErrors(*[np.inf] * 5)


def target_errors(estimate: Estimate, target: Target, model: Model) -> TargetErrors:
    """How far an estimate of a target is off."""
    maps, vertices = model.symmetry.transforms, model.vertices
    average = add if len(maps) == 1 else add_s
    turned = compose(model.symmetry.frame, np.zeros(3))
    _, rotation = pose_error(estimate.pose @ turned, target.truth @ turned, model.symmetry.group)
    origins = (estimate.pose @ maps)[:, :3, 3]  # those of other data sets may be about other points
    origin = np.linalg.norm(origins - target.truth[:3, 3], axis=1).min()
    pixels = mspd(estimate.pose, target.truth, maps, vertices, target.matrix)
    return TargetErrors(
        mssd=mssd(estimate.pose, target.truth, maps, vertices) / model.diameter,
        mspd=pixels * WIDTH / target.width,
        add=average(estimate.pose, target.truth, vertices) / model.diameter,
        origin=float(origin),
        rotation=float(rotation),
    )


def score(
    estimates: Sequence[Estimate],
    data: BopData,
    *,
    source: Path,
    progress: Callable[[int, int, str], None] | None = None,
) -> list[dict[str, str | int | float | None]]:
    """Rows of a table: all targets first, then by type, symmetry and category where the data set says them.

    Of several estimates of a target that of the highest score counts, of equal ones the first.

    Args:
      estimates: Of any of the targets.
      data: The data set.
      source: Of the estimates, for errors.
      progress: Told of every target.

    Raises:
      InputError: An estimate is of no target.
    """
    known = {target.key for target in data.targets}
    best: dict[tuple[int, int, int], Estimate] = {}
    for each in estimates:
        if each.key not in known:
            scene, image, model = each.key
            raise InputError(
                f"{source}: scene {scene}, image {image}, object {model} is no target of the data set"
            )
        if each.key not in best or each.score > best[each.key].score:
            best[each.key] = each
    errors = []
    for done, target in enumerate(data.targets, 1):
        model, estimate = data.models[target.model], best.get(target.key)
        errors.append(MISSED if estimate is None else target_errors(estimate, target, model))
        if progress is not None:
            progress(done, len(data.targets), f"object {target.model}")
    rows = []
    for group, name, members in _groups(data):
        own = [errors[i] for i in members]
        answered = [best[data.targets[i].key] for i in members if data.targets[i].key in best]
        # A time is that of its whole image.
        seconds = {each.key[:2]: each.seconds for each in answered}
        mean = _mean_time(list(seconds.values()))
        rows.append({"by": group, "name": name, **_recalls(own), "seconds": mean})
    return rows


def _groups(data: BopData) -> list[tuple[str, str, list[int]]]:
    """What is summed up together: the kind of group, its name, and its targets."""
    models = [data.models[target.model] for target in data.targets]
    found = [("all", "all", list(range(len(models))))]
    kinds: Mapping[str, Callable[[Model], str]] = {
        "type": lambda model: model.object_type,
        "symmetry": lambda model: model.symmetry.kind,
        "category": lambda model: model.category,
    }
    for kind, of in kinds.items():
        for name in sorted({of(model) for model in models} - {""}):
            found.append((kind, name, [i for i, model in enumerate(models) if of(model) == name]))
    return found


def _recalls(errors: Sequence[TargetErrors]) -> dict[str, int | float]:
    surface, pixels, average, origin, rotation = (
        np.array([getattr(each, name) for each in errors]) for name in TargetErrors.__annotations__
    )
    figures: dict[str, int | float] = {
        "n": len(errors),
        "estimated": int(np.isfinite(origin).sum()),
        "mssd": float((surface[:, None] < STEPS).mean()),
        "mspd": float((pixels[:, None] < 100 * STEPS).mean()),
        "add_s": float((average < ADD_SHARE).mean()),
    }
    for degrees, centimetres in BARS:
        right = (np.degrees(rotation) <= degrees) & (100 * origin <= centimetres)
        figures[f"recall_{degrees}deg_{centimetres}cm"] = float(right.mean())
    return figures


def _mean_time(seconds: Sequence[float]) -> float | None:
    """Mean of the times that are known."""
    known = [each for each in seconds if each >= 0]
    return float(np.mean(known)) if known else None
