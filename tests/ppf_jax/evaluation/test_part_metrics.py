"""Errors of handles and joints are what estimates are off by."""

from __future__ import annotations

import dataclasses

import pytest

from manipose_mj.ppf_jax.articulated_estimator import PartEstimate
from manipose_mj.ppf_jax.data.articulated.clouds import (
    fused_cloud,
    handle_poses,
)
from manipose_mj.ppf_jax.evaluation.part_metrics import PartErrors, part_errors, summary


def _exact(cloud) -> list[PartEstimate]:
    scene = cloud.scene
    return [
        PartEstimate(
            handle=pose,
            joint="hinge" if joint.hinge else "slide",
            axis_origin=cloud.pose[:3, :3] @ joint.origin + cloud.pose[:3, 3],
            axis=cloud.pose[:3, :3] @ joint.axis,
            opening=opening,
            confidence=0.9,
        )
        for pose, joint, opening in zip(
            handle_poses(cloud), scene.joints, scene.openings, strict=True
        )
    ]


def test_errors_are_what_estimates_are_off_by(scene):
    cloud = fused_cloud(scene, [0, 1, 2])
    estimates = _exact(cloud)
    errors, false_positives = part_errors(cloud, estimates[::-1], least_pixels=0)
    assert false_positives == 0 and len(errors) == len(scene.joints)
    assert summary(errors, false_positives, 1)["all_right"] == 1.0
    assert max(e.centre for e in errors) < 1e-6 and max(e.line for e in errors) < 1e-6
    pose = estimates[-1].handle.copy()
    pose[:3, 3] += [0.0, 0.02, 0.0]
    moved = dataclasses.replace(
        estimates[-1],
        handle=pose,
        axis_origin=estimates[-1].axis_origin + 0.03 * pose[:3, 1],
        joint="slide",
    )
    errors, false_positives = part_errors(cloud, [*estimates[:-1], moved, moved], least_pixels=0)
    assert false_positives == 1 and errors[-1].centre == pytest.approx(0.02, abs=1e-6)
    assert not errors[-1].handle_right and not errors[-1].type_right
    assert 0.001 < errors[-1].line <= 0.03 + 1e-6
    errors, false_positives = part_errors(cloud, [], least_pixels=0)
    assert false_positives == 0 and summary(errors, false_positives, 1)["found"] == 0.0


def test_an_object_is_right_if_most_of_its_parts_are():
    right = PartErrors("", True, True, 0.0, 0.0, True, 0.0, 0.0, 0.0, 0.9)
    wrong = dataclasses.replace(right, line=0.1)
    names = {"a/0 door_0": right, "a/1 door_0": wrong, "a/2 door_0": right, "b/0 door_0": right}
    errors = [dataclasses.replace(e, name=name) for name, e in names.items()]
    errors.append(dataclasses.replace(wrong, name="b/1 door_0"))
    # One whose axis does not show counts neither way.
    errors.append(dataclasses.replace(right, name="b/2 door_0", axis_visible=False))
    assert summary(errors, 0, 1)["objects_right"] == 0.5
