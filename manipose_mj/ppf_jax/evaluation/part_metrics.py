"""How far estimated handles and joints are from the true ones that a camera could see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from manipose_mj.errors import InputError
from manipose_mj.poses import pose_error, transform
from manipose_mj.ppf_jax.articulated_estimator import PartEstimate
from manipose_mj.ppf_jax.data.articulated.clouds import FurnitureCloud, handle_poses

# A handle both of whose ends are within the image and that at least so many measured pixels show, of 480 rows,
# counts as visible.
VISIBLE_PIXELS = 40
CENTRE_BAR, LINE_BAR = 0.015, 0.02  # [m]
ANGLE_BAR = float(np.radians(5.0))
MATCHED = 0.10  # an estimate that is further from every handle is of none of them [m]


@dataclass(frozen=True)
class PartErrors:
    """Errors of the estimate of one part; infinite where there is none.

    Attributes:
      name: The cloud and the part.
      hinge: Whether the part turns.
      axis_visible: Whether the joint's axis is within the image where it is nearest to the handle.
      centre: Of the handle [m].
      axes: Of the handle's rotation, the least over its symmetry group [rad].
      type_right: Whether the joint's type is.
      direction: Of the joint [rad].
      line: From the true axis, where it is nearest to the handle, to the estimated one [m]; 0 for a
        part that slides, whose axis has no place.
      opening: [m or rad].
      confidence: Of the estimate.
    """

    name: str
    hinge: bool
    axis_visible: bool
    centre: float
    axes: float
    type_right: bool
    direction: float
    line: float
    opening: float
    confidence: float

    @property
    def handle_right(self) -> bool:
        """Whether centre and axes are within their bars."""
        return self.centre <= CENTRE_BAR and self.axes <= ANGLE_BAR

    @property
    def joint_right(self) -> bool:
        """Whether type, direction and line are."""
        return self.type_right and self.direction <= ANGLE_BAR and self.line <= LINE_BAR

    @property
    def all_right(self) -> bool:
        """Whether handle and joint are."""
        return self.handle_right and self.joint_right


def part_errors(
    cloud: FurnitureCloud, estimates: Sequence[PartEstimate], *, least_pixels: int = VISIBLE_PIXELS
) -> tuple[list[PartErrors], int]:
    """Errors for every part whose handle a cloud shows (all parts if `least_pixels` is 0), and how many estimates are of no handle at all.

    Estimates and handles are paired so that the distances' sum is least. An estimate may also be of a
    handle that hardly shows; that counts neither way.
    """
    scene, truth = cloud.scene, handle_poses(cloud)
    found = np.array([e.handle[:3, 3] for e in estimates]).reshape(-1, 3)
    apart = np.linalg.norm(truth[:, None, :3, 3] - found, axis=-1)
    pairs = linear_sum_assignment(np.minimum(apart, MATCHED))
    matched = {i: j for i, j in zip(*pairs, strict=True) if apart[i, j] < MATCHED}
    false_positives = len(estimates) - len(matched)
    errors = []
    for i, joint in enumerate(scene.joints):
        if cloud.handle_pixels[i] < least_pixels or (least_pixels and not cloud.handle_framed[i]):
            continue
        shown = bool(cloud.axis_framed[i])
        name = f"{scene.name} {joint.name}"
        if i not in matched:
            inf = float("inf")
            errors.append(PartErrors(name, joint.hinge, shown, inf, inf, False, inf, inf, inf, 0.0))
            continue
        estimate = estimates[matched[i]]
        centre, axes = pose_error(estimate.handle.astype(float), truth[i], joint.symmetry)
        axis = cloud.pose[:3, :3] @ joint.axis
        line = 0.0
        if joint.hinge:
            origin = transform(cloud.pose, joint.origin[None])[0]
            foot = origin + ((truth[i, :3, 3] - origin) @ axis) * axis
            away = foot - estimate.axis_origin
            along = estimate.axis.astype(float)
            line = float(np.linalg.norm(away - (away @ along) * along))
        right = (estimate.joint == "hinge") == joint.hinge
        cosine = np.clip(estimate.axis @ axis, -1, 1)
        errors.append(
            PartErrors(
                name=name,
                hinge=joint.hinge,
                axis_visible=shown,
                centre=float(centre),
                axes=float(axes),
                type_right=right,
                direction=float(np.arccos(cosine)),
                line=line,
                opening=abs(estimate.opening - scene.openings[i]) if right else float("inf"),
                confidence=estimate.confidence,
            )
        )
    return errors, false_positives


def summary(
    errors: Sequence[PartErrors], false_positives: int, clouds: int
) -> dict[str, float | int]:
    """Figures of a table's row: cm, degrees, shares from 0 to 1; of joints, those whose axis is visible.

    An object is right if more than half of its parts that show, over all of its scenes, are.

    Args:
      errors: Of all parts that show.
      false_positives: Estimates of no handle at all.
      clouds: How many there were.

    Raises:
      InputError: There are no errors to sum up.
    """
    if not errors:
        raise InputError("no visible handle to sum up")

    def share(values: Sequence[bool]) -> float:
        return float(np.mean(values)) if len(values) else float("nan")

    def median(values: Sequence[float]) -> float:
        return float(np.median(values)) if len(values) else float("nan")

    hinges = [e for e in errors if e.hinge and e.axis_visible]
    joints = [e for e in errors if e.axis_visible]
    slides = [e for e in errors if not e.hinge]
    by_object: dict[str, list[bool]] = {}
    for e in joints:
        by_object.setdefault(e.name.split("/")[0], []).append(e.all_right)
    return {
        "n": len(errors),
        "found": share([np.isfinite(e.centre) for e in errors]),
        "centre_within": share([e.centre <= CENTRE_BAR for e in errors]),
        "axes_within": share([e.axes <= ANGLE_BAR for e in errors]),
        "type_right": share([e.type_right for e in errors]),
        "direction_within": share([e.direction <= ANGLE_BAR for e in errors]),
        "line_within": share([e.line <= LINE_BAR for e in hinges]),
        "handle_right": share([e.handle_right for e in errors]),
        "joint_right": share([e.joint_right for e in joints]),
        "all_right": share([e.all_right for e in joints]),
        "objects_right": share([sum(each) > len(each) / 2 for each in by_object.values()]),
        "centre_cm_median": 100 * median([e.centre for e in errors]),
        "axes_deg_median": float(np.degrees(median([e.axes for e in errors]))),
        "direction_deg_median": float(np.degrees(median([e.direction for e in errors]))),
        "line_cm_median": 100 * median([e.line for e in hinges]),
        "opening_deg_median": float(np.degrees(median([e.opening for e in hinges]))),
        "opening_cm_median": 100 * median([e.opening for e in slides]),
        "false_positives_per_cloud": false_positives / clouds,
    }
