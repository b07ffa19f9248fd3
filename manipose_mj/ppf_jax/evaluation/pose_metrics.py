"""How far estimated poses are from true ones, as this project, NOCS and BOP count it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup, invert, pose_error, transform
from manipose_mj.ppf_jax.data.source_frames import SourceLabel
from manipose_mj.ppf_jax.points.clouds import LabelledCloud

RECALLS: tuple[tuple[float, float], ...] = ((5, 2), (5, 5), (10, 2), (10, 5))  # [deg, cm]
FLIPPED = np.pi / 2
BOP_TURNS = 315  # samples of an axis of revolution in BOP's MSSD
HANDLED = ("mug",)  # NOCS lets these be turned about their axis while the handle is not seen
_HANDLE_GAP, _SLACK = 0.006, 0.01  # beyond the wall; beyond the label's box [m]
_HANDLE_POINTS, _HANDLE_SHARE = 5, 0.01  # of a cloud, from which a handle counts as seen


@dataclass(frozen=True)
class PoseErrors:
    """Errors of `n` estimates.

    Attributes:
      origin: `(n,)` [m], between label origins.
      rotation: `(n,)` [rad], the least over the symmetry group of the shape.
      textured_rotation: `(n,)` [rad], the least over the group of shape and print.
      nocs_rotation: `(n,)` [rad], the same, but the angle between the up axes where NOCS counts so.
      mssd: `(n,)` [m], BOP's maximum surface distance, the least over the group; NaN where no hull of
        the object was given.
    """

    origin: Float[np.ndarray, "n"]
    rotation: Float[np.ndarray, "n"]
    textured_rotation: Float[np.ndarray, "n"]
    nocs_rotation: Float[np.ndarray, "n"]
    mssd: Float[np.ndarray, "n"]

    def of(self, rows: np.ndarray) -> PoseErrors:
        """Those of some estimates."""
        return PoseErrors(
            self.origin[rows],
            self.rotation[rows],
            self.textured_rotation[rows],
            self.nocs_rotation[rows],
            self.mssd[rows],
        )


def pose_errors(
    estimates: Float[np.ndarray, "n 4 4"],
    clouds: Sequence[LabelledCloud],
    *,
    sources: Mapping[str, SourceLabel] | None = None,
    hulls: Mapping[str, Float[np.ndarray, "h 3"]] | None = None,
    textured: Mapping[str, SymmetryGroup] | None = None,
) -> PoseErrors:
    """The error of each estimate against its cloud's label.

    Args:
      estimates: `T_camera_label`, or with `sources` of the sources' frames.
      clouds: With unified labels.
      sources: By the object's name, where the estimates are of the sources' frames.
      hulls: Corners of the objects' convex hulls by their names, label frame [m]: no point of a shape
        moves further than one of them.
      textured: Groups of shape and print by the objects' names, where they are not the shapes'.

    Raises:
      InputError: There are not as many estimates as clouds, or some are not finite.
    """
    estimates = np.asarray(estimates, float)
    if estimates.shape != (len(clouds), 4, 4):
        raise InputError(f"estimates are {estimates.shape}; expected ({len(clouds)}, 4, 4)")
    if not np.isfinite(estimates).all():
        bad = int(np.flatnonzero(~np.isfinite(estimates).all(axis=(1, 2)))[0])
        raise InputError(f"the estimate of {clouds[bad].name} is not finite")
    members = {cloud.name.split("/")[0]: cloud.symmetry for cloud in clouds}
    turns = {owner: group.sampled(BOP_TURNS) for owner, group in members.items()}
    rows = []
    for estimate, cloud in zip(estimates, clouds, strict=True):
        owner, truth = cloud.name.split("/")[0], cloud.pose.astype(float)
        if sources is None:
            origin, rotation = pose_error(estimate, truth, cloud.symmetry)
        else:
            own = sources[owner].T_label_source
            origin = _source_origin_error(estimate, truth, turns[owner], own)
            estimate = estimate @ invert(own)
            _, rotation = pose_error(estimate, truth, cloud.symmetry)
        printed = (textured or {}).get(owner, cloud.symmetry)
        _, with_print = pose_error(estimate, truth, printed)
        nocs = rotation
        if cloud.category in HANDLED and not handle_seen(cloud):
            _, nocs = pose_error(estimate, truth, SymmetryGroup.about_x())
        distance = np.nan
        if hulls is not None:
            distance = mssd(estimate, truth, turns[owner], hulls[owner])
        rows.append([float(v) for v in (origin, rotation, with_print, nocs, distance)])
    return PoseErrors(*np.array(rows, float).reshape(-1, 5).T)


def _source_origin_error(
    estimate: Float[np.ndarray, "4 4"],
    T_camera_label: Float[np.ndarray, "4 4"],
    turns: Float[np.ndarray, "k 3 3"],
    T_label_source: Float[np.ndarray, "4 4"],
) -> float:
    """Between origins; a symmetry about the label's origin moves a source's that is off the axis."""
    equivalent = transform(T_camera_label, turns @ T_label_source[:3, 3])
    return float(np.linalg.norm(equivalent - estimate[:3, 3], axis=-1).min())


def mssd(
    estimate: Float[np.ndarray, "4 4"],
    truth: Float[np.ndarray, "4 4"],
    turns: Float[np.ndarray, "k 3 3"],
    hull: Float[np.ndarray, "h 3"],
) -> float:
    """BOP's maximum symmetry-aware surface distance [m].

    Hodan et al., "BOP Challenge 2020 on 6D object localization": the largest distance of a vertex, the
    least over the symmetries, an axis of revolution in 315 steps. A convex function on a shape is
    largest at a corner of its hull.

    Args:
      estimate: `T_camera_label`.
      truth: `T_camera_label`.
      turns: The object's symmetry group, an axis of revolution in `BOP_TURNS` samples.
      hull: Corners of its convex hull, label frame [m].
    """
    turned = np.einsum("kij,hj->khi", turns, hull)
    apart = transform(truth, turned) - transform(estimate, hull)
    return float(np.sqrt((apart**2).sum(axis=-1).max(axis=-1).min()))


def handle_seen(cloud: LabelledCloud) -> bool:
    """Whether a cloud shows what sticks out of a mirror-symmetric vessel on its Y side.

    The box of such a label is as deep along Z as the body is round; what lies further along Y than
    the body reaches is the handle.
    """
    x, y, z = transform(invert(cloud.pose.astype(float)), cloud.points.astype(float)).T
    half_x, half_y, half_z = cloud.extents / 2
    beyond = (y > -half_y + 2 * half_z + _HANDLE_GAP) & (y < half_y + _SLACK)
    beyond &= (np.abs(x) < half_x + _SLACK) & (np.abs(z) < half_z)
    return bool(np.count_nonzero(beyond) >= max(_HANDLE_POINTS, _HANDLE_SHARE * len(cloud)))


def summary(errors: PoseErrors) -> dict[str, float | int]:
    """Figures of a table's row: cm and degrees, shares from 0 to 1.

    Raises:
      InputError: There are no errors to sum up.
    """
    count = len(errors.origin)
    if not count:
        raise InputError("no estimates to sum up")
    origin, degrees = 100 * errors.origin, np.degrees(errors.rotation)
    nocs, printed = np.degrees(errors.nocs_rotation), np.degrees(errors.textured_rotation)
    figures: dict[str, float | int] = {
        "n": count,
        "origin_cm_mean": float(origin.mean()),
        "origin_cm_median": float(np.median(origin)),
        "deg_mean": float(degrees.mean()),
        "deg_median": float(np.median(degrees)),
        "textured_deg_mean": float(printed.mean()),
        "textured_deg_median": float(np.median(printed)),
        "nocs_deg_mean": float(nocs.mean()),
        "nocs_deg_median": float(np.median(nocs)),
        "flipped": float((errors.rotation > FLIPPED).mean()),
        "mssd_cm_mean": float(100 * errors.mssd.mean()),
    }
    for deg, cm in RECALLS:
        figures[f"recall_{deg}deg_{cm}cm"] = float(((degrees <= deg) & (origin <= cm)).mean())
    return figures


def most_confident(confidence: Float[np.ndarray, "n"], share: float) -> Bool[np.ndarray, "n"]:
    """The `share` of estimates with the highest confidence; of equal ones the first."""
    kept = np.zeros(len(confidence), bool)
    kept[np.argsort(-confidence, kind="stable")[: round(share * len(confidence))]] = True
    return kept
