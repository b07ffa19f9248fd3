"""MSSD, MSPD, ADD and ADD-S are what their publications say, over symmetries as `models_info.json` lists them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from manipose_mj.bop.dataset import Model, Target
from manipose_mj.bop.pose_distances import add, add_s, mspd, mssd
from manipose_mj.bop.results_csv import Estimate
from manipose_mj.bop.score import target_errors
from manipose_mj.bop.symmetries import TURNS, model_symmetry
from manipose_mj.poses import compose

K = np.array([[580.0, 0.0, 319.5], [0.0, 575.0, 239.5], [0.0, 0.0, 1.0]])
HALF_TURN = [-1, 0, 0, 20, 0, -1, 0, -10, 0, 0, 1, 0, 0, 0, 0, 1]  # about z through (10, -5, 0) mm
FLIP = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1]
INFOS = {
    "none": {},
    "discrete": {"symmetries_discrete": [HALF_TURN]},
    "axial": {"symmetries_continuous": [{"axis": [0, 0, 1], "offset": [10, -5, 0]}]},
    "axial and flip": {
        "symmetries_continuous": [{"axis": [0, 0, 1], "offset": [0, 0, 0]}],
        "symmetries_discrete": [FLIP],
    },
}


def listed(info) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rotation and translation [m] of every symmetry, from BOP's format description alone."""
    found = [(np.eye(3), np.zeros(3))]
    for entry in info.get("symmetries_discrete", []):
        matrix = np.reshape(entry, (4, 4)).astype(float)
        found.append((matrix[:3, :3], matrix[:3, 3] / 1000))
    for entry in info.get("symmetries_continuous", []):
        axis, offset = np.array(entry["axis"], float), np.array(entry["offset"], float) / 1000
        turns = [Rotation.from_rotvec(2 * np.pi * i / 315 * axis).as_matrix() for i in range(315)]
        found = [
            (turn @ rotation, turn @ shift + offset - turn @ offset)
            for rotation, shift in found
            for turn in turns
        ]
    return found


def reference(estimate, truth, symmetries, vertices) -> tuple[float, float]:
    """min over S of max over x of |P_est x - P_gt S x|, in space and in the image."""
    rotations = np.stack([rotation for rotation, _ in symmetries])
    shifts = np.stack([shift for _, shift in symmetries])
    turned = np.einsum("sij,vj->svi", rotations, vertices) + shifts[:, None]
    there = np.einsum("ij,svj->svi", truth[:3, :3], turned) + truth[:3, 3]
    here = np.einsum("ij,vj->vi", estimate[:3, :3], vertices) + estimate[:3, 3]
    apart = np.sqrt(((there - here) ** 2).sum(axis=2)).max(axis=1).min()

    def seen(points):
        u = K[0, 0] * points[..., 0] / points[..., 2] + K[0, 2]
        return np.stack([u, K[1, 1] * points[..., 1] / points[..., 2] + K[1, 2]], axis=-1)

    pixels = np.sqrt(((seen(there) - seen(here)) ** 2).sum(axis=2)).max(axis=1).min()
    return float(apart), float(pixels)


def random_pose(rng, near=None) -> np.ndarray:
    if near is None:
        rotation = Rotation.random(random_state=rng).as_matrix()
        return compose(rotation, rng.uniform([-0.2, -0.2, 0.5], [0.2, 0.2, 1.2]))
    turn = Rotation.from_rotvec(rng.normal(0, 0.3, 3)).as_matrix()
    return compose(near[:3, :3] @ turn, near[:3, 3] + rng.normal(0, 0.02, 3))


@pytest.mark.sample(2)
@pytest.mark.parametrize("kind", list(INFOS))
def test_mssd_and_mspd_equal_the_published_formulas(kind):
    """250 poses for each of four kinds of symmetry: far ones, and near ones."""
    rng = np.random.default_rng(len(kind))
    maps, symmetries = model_symmetry(INFOS[kind]).transforms, listed(INFOS[kind])
    assert len(maps) == len(symmetries)
    vertices = rng.normal(0, 0.04, (20, 3))
    for i in range(250):
        truth = random_pose(rng)
        estimate = random_pose(rng, truth if i % 2 else None)
        apart, pixels = reference(estimate, truth, symmetries, vertices)
        assert mssd(estimate, truth, maps, vertices) == pytest.approx(apart, abs=1e-6)
        assert mspd(estimate, truth, maps, vertices, K) == pytest.approx(pixels, abs=1e-6)


def test_symmetric_poses_are_no_error():
    rng = np.random.default_rng(0)
    vertices, truth = rng.normal(0, 0.04, (60, 3)), random_pose(rng)
    for info in INFOS.values():
        symmetry = model_symmetry(info)
        for each in symmetry.transforms[::50]:
            assert mssd(truth @ each, truth, symmetry.transforms, vertices) < 1e-9
            assert mspd(truth @ each, truth, symmetry.transforms, vertices, K) < 1e-6


def test_add_is_the_mean_and_add_s_the_mean_to_the_nearest():
    rng = np.random.default_rng(1)
    vertices, truth = rng.normal(0, 0.04, (80, 3)), random_pose(rng)
    estimate = random_pose(rng, truth)
    here = (estimate[:3, :3] @ vertices.T).T + estimate[:3, 3]
    there = (truth[:3, :3] @ vertices.T).T + truth[:3, 3]
    every = np.linalg.norm(there[:, None] - here[None], axis=2)
    assert add(estimate, truth, vertices) == pytest.approx(np.diag(every).mean(), abs=1e-12)
    assert add_s(estimate, truth, vertices) == pytest.approx(every.min(axis=1).mean(), abs=1e-12)


def test_kinds_and_frames_of_symmetries():
    kinds = {name: model_symmetry(info).kind for name, info in INFOS.items()}
    assert kinds == {
        "none": "none", "discrete": "discrete", "axial": "axial", "axial and flip": "axial",
    }  # fmt: skip
    both = model_symmetry(INFOS["axial and flip"])
    assert len(both.transforms) == 2 * TURNS and both.group.axial
    np.testing.assert_allclose(both.frame[:, 0], [0, 0, 1])
    assert np.linalg.det(both.frame) == pytest.approx(1)


@pytest.mark.parametrize(
    ("info", "message"),
    [
        ({"symmetries_discrete": [[*([1.0] * 16)]]}, "not a proper rotation"),
        ({"symmetries_continuous": 2 * INFOS["axial"]["symmetries_continuous"]}, "several"),
    ],
)
def test_what_is_no_symmetry(info, message):
    with pytest.raises(ValueError, match=message):
        model_symmetry(info)


@pytest.mark.parametrize("kind", ["discrete", "axial"])
def test_origins_are_compared_up_to_symmetries_about_other_points(kind):
    symmetry = model_symmetry(INFOS[kind])
    vertices = np.random.default_rng(0).normal(0, 0.03, (40, 3))
    truth = compose(Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix(), np.array([0.1, 0.0, 0.8]))
    target = Target(0, 0, 1, truth, K, 640)
    model = Model(vertices, 0.2, symmetry, "", "")
    turned = truth @ symmetry.transforms[len(symmetry.transforms) // 2]
    assert np.linalg.norm((turned - truth)[:3, 3]) > 0.02
    errors = target_errors(Estimate(0, 0, 1, 1.0, turned, -1.0), target, model)
    assert errors.origin < 1e-9 and errors.rotation < 1e-6
    beside = compose(np.eye(3), np.array([0.0, 0.0, 0.05])) @ turned
    errors = target_errors(Estimate(0, 0, 1, 1.0, beside, -1.0), target, model)
    assert 0.02 < errors.origin <= 0.05 + 1e-9
