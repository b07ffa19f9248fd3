"""Handles and joints of furniture: labels, votes and answers, without a trained model."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from manipose_mj.errors import InputError
from manipose_mj.poses import rotation_about
from manipose_mj.ppf_jax import articulated_estimator
from manipose_mj.ppf_jax import articulated_model as module
from manipose_mj.ppf_jax.articulated_cache import (
    furniture_scenes,
    furniture_stream,
    parallel_furniture_stream,
    random_scene,
)
from manipose_mj.ppf_jax.articulated_clouds import (
    CLOUD_POINTS,
    FurnitureScene,
    batch_furniture,
    fused_cloud,
    handle_poses,
)
from manipose_mj.ppf_jax.articulated_estimator import ArticulatedEstimator, PartEstimate
from manipose_mj.ppf_jax.articulated_losses import ArticulatedLoss, varied
from manipose_mj.ppf_jax.articulated_metrics import PartErrors, part_errors, summary
from manipose_mj.ppf_jax.articulated_model import ArticulatedConfig, ArticulatedModel
from manipose_mj.ppf_jax.articulated_subject import catalogue_furniture
from manipose_mj.ppf_jax.articulated_views import FurnitureSetting, render_furniture
from manipose_mj.ppf_jax.body_frame import BODY_IN_LABEL, aligned, candidates
from manipose_mj.ppf_jax.network import NetworkConfig
from manipose_mj.ppf_jax.part_network import (
    LENGTH,
    SLIDE_LENGTH,
    TURN,
    VOTES,
    PartNetworkConfig,
    PointVotes,
    taken,
)
from manipose_mj.ppf_jax.part_voting import PartVotingConfig, find_parts, frame_turn
from manipose_mj.ppf_jax.rotations import from_vector
from manipose_mj.ppf_jax.weights import TrainedModel, load_weights, save_weights

KEY = jax.random.key(0)
SETTING = FurnitureSetting(image_heights=(120,), all_shut=0.0, shut=0.0)
CONFIG = ArticulatedConfig(
    body=NetworkConfig(neighbours=4, anchors=4, local_width=8, width=8, pair_width=8),
    body_points=64,
    body_pairs=1000,
    network=PartNetworkConfig(
        width=8, hidden=8, neighbours=4, among=(128, 64), reach=(0.03, 0.1), anchors=4
    ),
    voting=PartVotingConfig(parts=4, candidates=32),
    points=128,
)


@pytest.fixture(scope="module")
def cabinet():
    return catalogue_furniture("cabinet", 0)


@pytest.fixture(scope="module")
def scene(cabinet) -> FurnitureScene:
    return random_scene(cabinet, SETTING, 0, np.random.default_rng(3))


@pytest.fixture(scope="module")
def sample(scene):
    """One row of a batch, all of whose parts stand open."""
    rng = np.random.default_rng(0)
    batch = batch_furniture([fused_cloud(scene, [0, 1])], rng=rng, points=1024, focus=1.0)
    return jax.tree.map(lambda leaf: jnp.asarray(leaf[0]), batch)


@pytest.fixture(scope="module")
def estimator():
    return ArticulatedEstimator(ArticulatedModel(CONFIG, rng=np.random.default_rng(1)))


def test_labels_move_with_their_parts(cabinet):
    drawer, door = cabinet.joints[0], cabinet.joints[-1]
    assert not drawer.hinge and door.hinge
    out = drawer.motion(0.2) @ drawer.handle
    np.testing.assert_allclose(out[:3, 3] - drawer.handle[:3, 3], 0.2 * drawer.axis, atol=1e-9)
    turned = door.motion(0.7) @ door.handle
    assert np.arccos(turned[:3, 1] @ door.handle[:3, 1]) == pytest.approx(0.7, abs=1e-6)
    # Opening leads away from the body, whose front is towards -x.
    assert turned[0, 3] < door.handle[0, 3]


def test_points_on_handles_are_where_handles_are(cabinet):
    openings = np.array([0.1, 0.0, 0.05, 0.4])
    rng = np.random.default_rng(0)
    setting = dataclasses.replace(SETTING, image_heights=(240,))
    view = render_furniture(cabinet, openings, setting, rng)
    assert view.handle.any() and (view.part[view.handle] >= 0).all()
    scene = FurnitureScene("a/0", "cabinet", cabinet.label.pose, cabinet.joints, openings, (view,))
    cloud = fused_cloud(scene, [0])
    for i, pose in enumerate(handle_poses(cloud)):
        own = cloud.points[cloud.handle & (cloud.part == i)]
        if len(own):
            within = np.linalg.norm(own - pose[:3, 3], axis=1)
            assert within.max() < 0.5 * np.linalg.norm(cabinet.joints[i].handle_extents) + 0.02
    assert (np.sum(view.normals * view.points, axis=1) < 0.01).mean() > 0.98


def test_fused_views_agree(scene):
    """Points of two cameras lie on the same handles once they are in one frame."""
    cloud = fused_cloud(scene, [0, 1, 2])
    assert len(cloud.points) > len(scene.views[0].points)
    poses = handle_poses(cloud)
    for i in range(len(poses)):
        own = cloud.points[cloud.handle & (cloud.part == i)]
        reach = 0.5 * np.linalg.norm(scene.joints[i].handle_extents) + 0.02
        assert not len(own) or np.linalg.norm(own - poses[i, :3, 3], axis=1).max() < reach


def _true_votes(targets, known) -> PointVotes:
    """As if every point on a moving part knew all."""
    count = len(known["moving"])
    values = {
        name: value if name == "turn" else jnp.where(known["moving"][:, None], value, 0.0)
        for name, value in targets.items()
    }
    logits = 20.0 * jax.nn.one_hot(known["classes"], 3)
    hinge = jnp.where(known["hinge"], 10.0, -10.0)
    scales = dict.fromkeys(VOTES, jnp.full(count, -3.0))
    return PointVotes(logits, hinge, values, scales, jnp.zeros(()))


def test_batches_are_the_same_whoever_makes_them(tmp_path, monkeypatch):
    monkeypatch.setenv("MANIPOSE_CACHE", str(tmp_path))
    objects = [("microwave", 0)]
    scenes = furniture_scenes(objects, "training", scenes=2)
    alone = furniture_stream(scenes, 2, seed=3)(5)
    helped = parallel_furniture_stream(objects, "training", scenes=2, batch=2, seed=3, jobs=2)(5)
    for _ in range(9):  # more than are made ahead
        jax.tree.map(np.testing.assert_array_equal, next(alone), next(helped))


@pytest.mark.parametrize("seed", range(6))
def test_true_votes_give_the_true_parts(sample, seed):
    """Turned, mirrored, enlarged: what points vote for stays one consistent piece of furniture."""
    cloud, targets, known = varied(
        sample, ArticulatedLoss(rolled=0.0, strange=0.0), key=jax.random.key(seed)
    )
    votes = _true_votes(targets, known)
    # Frames are some degrees off; what is seen of a handle may be a part of it.
    config = PartVotingConfig(snap=0.0)
    parts = jax.jit(find_parts, static_argnums=2)(cloud, votes, config)
    seen = np.unique(np.asarray(sample.part[sample.part >= 0]))
    turn = from_vector(frame_turn(cloud, votes, PartVotingConfig()))
    for part in seen:
        row = int(np.argmax(np.asarray(sample.part) == part))
        centre = cloud.points[row] + LENGTH * targets["centre"][row]
        found = int(jnp.argmin(jnp.linalg.norm(parts.centre - centre, axis=1)))
        np.testing.assert_allclose(parts.centre[found], centre, atol=1e-3)
        y, axis = parts.rotation[found][:, 1], parts.axis[found]
        hinge = bool(sample.hinge[part])
        assert (parts.hinge[found] > 0.5) == hinge
        opening = float(parts.opening[found])
        if hinge:
            assert opening == pytest.approx(float(sample.opening[part]), abs=1e-3)
            y = rotation_about(np.asarray(axis, float), -opening) @ np.asarray(y, float)
            line = cloud.points[row] + LENGTH * targets["line"][row] - parts.line[found]
            across = line - (line @ axis) * axis
            assert float(jnp.linalg.norm(across)) < 2e-3
        else:
            assert opening == pytest.approx(
                SLIDE_LENGTH * float(targets["opening"][row, 0]), abs=1e-3
            )
            assert float(axis @ y) > 0.999
        # Shut, every handle looks out of the front, which is the frame's first axis once that is righted.
        assert float(np.asarray(turn)[:, 0] @ np.asarray(y)) > 0.999
    assert float(jnp.abs(targets["turn"]).max()) * TURN < 0.3


@pytest.mark.parametrize(("across", "parts"), [(False, 1), (True, 2)])
def test_votes_spread_along_a_handle_are_one_part_and_across_it_two(sample, across, parts):
    """Half of a handle's points say 3 cm this way, half that way."""
    cloud, targets, known = varied(
        sample, ArticulatedLoss(rolled=0.0, strange=0.0, stretch=0.0), key=jax.random.key(0)
    )
    on = np.asarray(known["classes"]) == 2
    of = np.asarray(sample.part)
    part = np.bincount(of[on]).argmax()
    row = int(np.argmax(on & (of == part)))
    x, y = (np.asarray(targets[name][row]) for name in ("x", "y"))
    way = np.cross(x, y) if across else x
    sides = np.where(np.arange(len(of)) % 2 == 0, 0.03, -0.03)[:, None] / LENGTH
    targets["centre"] = targets["centre"] + sides * way
    own = jnp.asarray(of == part)
    known = {name: jnp.where(own, value, 0) for name, value in known.items()}
    config = PartVotingConfig(snap=0.0)
    found = jax.jit(find_parts, static_argnums=2)(cloud, _true_votes(targets, known), config)
    assert int(jnp.sum(found.evidence[:, 2] > 0)) == parts


def test_planes_settle_the_frame():
    rng = np.random.default_rng(0)
    walls = []
    for axis in range(3):
        flat = rng.uniform(0.0, 0.5, (400, 3))
        flat[:, axis] = rng.normal(0.0, 0.002, 400)
        walls.append(flat)
    # Normals that lean towards the camera by some degrees.
    normals = np.repeat(np.eye(3), 400, axis=0) + [0.08, 0.08, 0.08]
    normals = normals + rng.normal(0.0, 0.08, normals.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    truth = rotation_about(np.array([0.6, 0.0, 0.8]), 1.1)
    order = rng.permutation(1200)
    points = np.concatenate(walls)[order] @ truth.T
    normals = normals[order] @ truth.T
    start = truth @ rotation_about(np.array([0.0, 0.6, 0.8]), 0.12)
    mask = jnp.arange(1200) < 1100
    found, _ = jax.jit(aligned)(
        jnp.asarray(start, jnp.float32), jnp.asarray(points), jnp.asarray(normals), mask
    )
    cosine = (np.trace(truth.T @ np.asarray(found)) - 1) / 2
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))) < 0.3


def test_one_candidate_is_the_bodys_frame():
    truth = np.asarray(from_vector(jnp.array([0.3, -1.2, 0.5])))
    towards = truth @ np.array([0.8, 0.36, 0.48])
    frames = np.asarray(candidates(jnp.asarray(truth), jnp.asarray(towards)))
    np.testing.assert_allclose(frames[0], truth, atol=1e-6)
    for start in (truth[:, [2, 0, 1]], truth @ np.diag([-1.0, -1.0, 1.0]), frames[3]):
        others = np.asarray(candidates(jnp.asarray(start), jnp.asarray(towards)))
        assert (others[:, :, 0] @ towards > 0).all()
        np.testing.assert_allclose(np.linalg.det(others), 1.0, atol=1e-5)
        # The body's own, or half a turn about its front from it.
        alike = np.abs(np.einsum("ji,kji->ki", truth, others))
        right = (alike > 0.999).all(axis=1)
        assert right.sum() == 1 and truth[:, 0] @ others[right][0][:, 0] > 0.999


def test_gradients_of_taken_rows_are_those_of_indexing():
    rng = np.random.default_rng(0)
    rows = jnp.asarray(rng.normal(size=(7, 3)), jnp.float32)
    index = jnp.asarray(rng.integers(7, size=(40, 5)))
    weight = jnp.asarray(rng.normal(size=(40, 5, 3)), jnp.float32)
    plain = jax.grad(lambda r: jnp.sum(weight * r[index] ** 2))(rows)
    ours = jax.grad(lambda r: jnp.sum(weight * taken(r, index) ** 2))(rows)
    np.testing.assert_allclose(ours, plain, rtol=1e-5, atol=1e-5)


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
    errors, strange = part_errors(cloud, estimates[::-1], least_pixels=0)
    assert strange == 0 and len(errors) == len(scene.joints)
    assert summary(errors, strange, 1)["all_right"] == 1.0
    assert max(e.centre for e in errors) < 1e-6 and max(e.line for e in errors) < 1e-6
    pose = estimates[-1].handle.copy()
    pose[:3, 3] += [0.0, 0.02, 0.0]
    moved = dataclasses.replace(
        estimates[-1],
        handle=pose,
        axis_origin=estimates[-1].axis_origin + 0.03 * pose[:3, 1],
        joint="slide",
    )
    errors, strange = part_errors(cloud, [*estimates[:-1], moved, moved], least_pixels=0)
    assert strange == 1 and errors[-1].centre == pytest.approx(0.02, abs=1e-6)
    assert not errors[-1].handle_right and not errors[-1].type_right
    assert 0.001 < errors[-1].line <= 0.03 + 1e-6
    errors, strange = part_errors(cloud, [], least_pixels=0)
    assert strange == 0 and summary(errors, strange, 1)["found"] == 0.0


def test_an_object_is_right_if_most_of_its_parts_are():
    right = PartErrors("", True, True, 0.0, 0.0, True, 0.0, 0.0, 0.0, 0.9)
    wrong = dataclasses.replace(right, line=0.1)
    names = {"a/0 door_0": right, "a/1 door_0": wrong, "a/2 door_0": right, "b/0 door_0": right}
    errors = [dataclasses.replace(e, name=name) for name, e in names.items()]
    errors.append(dataclasses.replace(wrong, name="b/1 door_0"))
    # One whose axis does not show counts neither way.
    errors.append(dataclasses.replace(right, name="b/2 door_0", axis_visible=False))
    assert summary(errors, 0, 1)["objects_right"] == 0.5


def test_any_cloud_gets_answers_that_are_finite_and_repeatable(estimator, scene, monkeypatch):
    cloud = fused_cloud(scene, [0])
    traced = []
    whole = module.estimate_parts
    monkeypatch.setattr(
        module,
        "estimate_parts",
        lambda *args, key: traced.append(len(args[1])) or whole(*args, key=key),
    )
    answers = [
        estimator.estimate(cloud.points[:count], key=KEY, least=0.0) for count in (300, 999, 999)
    ]
    assert set(traced) == {2048}
    assert all(len(parts) == CONFIG.voting.parts for parts in answers)
    for part in answers[0]:
        assert np.isfinite(part.handle).all() and np.isfinite(part.axis_origin).all()
        # Also of a part that no point votes for.
        assert np.linalg.det(part.handle[:3, :3]) == pytest.approx(1.0, abs=1e-3)
        assert np.linalg.norm(part.axis) == pytest.approx(1.0, abs=1e-3)
        np.testing.assert_allclose(
            part.handle[:3, :3] @ part.handle[:3, :3].T, np.eye(3), atol=1e-3
        )
        assert part.opening >= 0 and 0 <= part.confidence <= 1
    for one, other in zip(answers[1], answers[2], strict=True):
        assert np.array_equal(one.handle, other.handle)


@pytest.mark.parametrize(
    ("count", "size"),
    [(300, 2048), (2049, 8192), (9000, 32_768), (65_000, 65_536), (70_000, 65_536)],
)
def test_clouds_are_padded_to_few_sizes(estimator, scene, monkeypatch, count, size):
    """One compilation each; none of a large cloud is dropped."""

    class Enough(Exception):
        pass

    def stopped(model, points, normals, mask, up, *, key):
        assert points.shape == normals.shape == (1, size, 3)
        assert mask.sum() == min(count, CLOUD_POINTS)
        raise Enough

    monkeypatch.setattr(articulated_estimator, "estimate_furniture", stopped)
    view = scene.views[0]
    rows = np.arange(count) % len(view.points)
    cloud = SimpleNamespace(points=view.points[rows], normals=view.normals[rows])
    with pytest.raises(Enough):
        estimator.estimate(cloud, key=KEY)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: p[:40], "cloud of 40 points; expected at least 256"),
        (lambda p: p * 1000, r"millimetres\? divide by 1000"),
        (lambda p: p * 0 + 1, "all points are equal"),
        (lambda p: p[:, :2], r"expected numbers, \(points, 3\)"),
        (
            lambda p: np.where(np.arange(len(p))[:, None] < 3, np.nan, p),
            "3 of .* points are not finite",
        ),
    ],
)
def test_clouds_that_cannot_be_used(estimator, scene, change, message):
    with pytest.raises(InputError, match=message):
        estimator.estimate(change(scene.views[0].points), key=KEY)


def test_an_up_that_is_no_direction(estimator, scene):
    with pytest.raises(InputError, match="expected a direction"):
        estimator.estimate(scene.views[0].points, key=KEY, up=(0, 0, 0))


def test_weights_come_back(estimator, tmp_path):
    path = tmp_path / "furniture.npz"
    save_weights(path, TrainedModel(estimator.model, ("cabinet",)))
    again = ArticulatedEstimator.from_file(path)
    assert again.model.config == CONFIG
    leaves = zip(jax.tree.leaves(again.model), jax.tree.leaves(estimator.model), strict=True)
    for one, other in leaves:
        np.testing.assert_allclose(one, other, rtol=1e-3, atol=1e-3)
    assert load_weights(path).categories == ("cabinet",)
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(InputError, match="not a whole file of weights"):
        ArticulatedEstimator.from_file(path)


def test_body_columns_are_front_up_and_side(cabinet):
    rotation = cabinet.label.rotation @ BODY_IN_LABEL
    np.testing.assert_allclose(rotation[:, 0], [-1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(rotation[:, 1], [0, 0, 1], atol=1e-6)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_training_steps_have_gradients_for_every_weight(estimator, sample):
    few = jax.tree.map(lambda leaf: leaf, sample)
    few = dataclasses.replace(
        few, **{n: getattr(few, n)[:128] for n in ("points", "normals", "mask", "part", "handle")}
    )
    loss = ArticulatedLoss(pairs=50, strange=0.0)

    def total(model, key):
        return loss(model, few, key=key)[0]

    gradient = jax.jit(jax.grad(total))(estimator.model, KEY)
    leaves = jax.tree.leaves_with_path(gradient)
    assert all(np.isfinite(leaf).all() for _, leaf in leaves)
    still = [jax.tree_util.keystr(path) for path, leaf in leaves if not np.any(leaf)]
    # Extents are not asked for, and confidence is fitted afterwards.
    assert all("size" in name or "calibration" in name for name in still), still
