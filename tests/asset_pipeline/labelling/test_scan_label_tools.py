"""Labels of made-up tools in any attitude: mirror plane, grip axis, joint, axes and group."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from asset_pipeline.labelling.scan_label import scan_label
from asset_pipeline.labelling.sections import Sections, joint, straight_line
from manipose_mj.assets.label import PoseLabel

TURN = Rotation.from_rotvec([0.9, -1.7, 0.6]).as_matrix()
SHIFT = np.array([0.2, -0.1, 0.05])


def _bar(start: float, stop: float, y: float, z: float) -> trimesh.Trimesh:
    """A round bar along x, of half widths y and z."""
    bar = trimesh.creation.cylinder(1.0, stop - start, sections=32)
    bar.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    bar.apply_scale([1, y, z])
    return bar.apply_translation([(start + stop) / 2, 0, 0])


def _block(low: list[float], high: list[float]) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[low, high])


def _labelled(parts: list[trimesh.Trimesh], category: str, **more) -> tuple[PoseLabel, float]:
    """The label of the joined parts, moved back into the frame they were drawn in."""
    tool = trimesh.boolean.union(parts)
    cut = trimesh.remesh.subdivide_to_size(tool.vertices, tool.faces, 0.006, max_iter=20)
    vertices, faces = cut[:2]
    noise = np.random.default_rng(1).normal(0, 0.0004, vertices.shape)
    scan = trimesh.Trimesh(vertices @ TURN.T + SHIFT + noise, faces, process=False)
    label, quality = scan_label(scan, "functional", None, category=category, **more)
    back = PoseLabel(
        TURN.T @ (label.origin - SHIFT),
        TURN.T @ label.rotation,
        label.object_type,
        label.extents,
        label.symmetry,
    )
    return back, quality.confidence


def _hammer(claw: float = 0.09) -> list[trimesh.Trimesh]:
    """Handle along x from -0.25; the head across it, farther to -y."""
    head = _block([0, -claw, -0.012], [0.028, 0.045, 0.012])
    return [_bar(-0.25, 0.015, 0.015, 0.011), head]


def test_a_hammer_points_to_its_head_and_z_to_the_claw():
    label, confidence = _labelled(_hammer(), "hammer")
    expected = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])  # Z is -y, Y = Z x X is -z
    assert np.linalg.norm(label.rotation[:, 0] - expected[:, 0]) < 0.02
    np.testing.assert_allclose(label.rotation[:, 2], [0, -1, 0], atol=0.03)
    np.testing.assert_allclose(label.origin, 0, atol=0.004)
    assert len(label.symmetry.rotations) == 1 and confidence > 0.7


def test_a_mallet_has_the_half_turn():
    label, _ = _labelled(_hammer(claw=0.045), "hammer")
    assert len(label.symmetry.rotations) == 2
    np.testing.assert_allclose(label.rotation[:, 0], [1, 0, 0], atol=0.01)


def test_a_driver_points_along_its_shank_and_may_turn_freely():
    parts = [_bar(-0.1, 0, 0.015, 0.015), _bar(-0.01, 0.12, 0.003, 0.003)]
    label, _ = _labelled(parts, "screwdriver")
    np.testing.assert_allclose(label.rotation[:, 0], [1, 0, 0], atol=0.01)
    np.testing.assert_allclose(label.origin, 0, atol=0.003)
    assert label.symmetry.axial and len(label.symmetry.rotations) == 1


def test_a_pan_looks_away_from_the_side_that_hangs_below():
    body = trimesh.creation.cylinder(0.09, 0.04).apply_translation([0.09, 0, -0.015])
    label, _ = _labelled([_bar(-0.18, 0.01, 0.011, 0.008), body], "pan")
    np.testing.assert_allclose(
        label.rotation, np.diag([1.0, 1, 1])[:, [0, 2, 1]] * [1, 1, -1], atol=0.03
    )
    np.testing.assert_allclose(label.origin, 0, atol=0.005)


def test_a_known_direction_beats_the_hint():
    parts = [_bar(-0.1, 0, 0.015, 0.015), _bar(-0.01, 0.12, 0.003, 0.003)]
    label, _ = _labelled(parts, "screwdriver", functional=TURN @ [-1.0, 0.2, 0.0])
    np.testing.assert_allclose(label.rotation[:, 0], [-1, 0, 0], atol=0.01)


def test_an_unknown_tool_works_with_its_thin_end():
    parts = [_bar(-0.1, 0, 0.015, 0.012), _block([-0.01, -0.008, -0.002], [0.11, 0.02, 0.002])]
    label, _ = _labelled(parts, "never heard of")
    np.testing.assert_allclose(label.rotation[:, 0], [1, 0, 0], atol=0.03)


def _profile(width: np.ndarray) -> Sections:
    place = np.linspace(0, 0.2, len(width))
    return Sections(place, width.copy(), width, np.zeros_like(width))


@pytest.mark.parametrize("slope", [False, True])
def test_the_joint_is_where_a_step_is_or_a_slope_begins(slope: bool):
    place = np.linspace(0, 0.2, 140)
    if slope:
        width = np.where(place > 0.16, 0.01 - (place - 0.16) / 0.04 * 0.009, 0.01)
    else:
        width = np.where(place > 0.16, 0.004, 0.01)
    at, size = joint(
        _profile(width),
        thickness_only=False,
        largest=False,
        step=0.35,
        begun=0.12,
        reach=(0.28, 0.95),
    )
    assert at == pytest.approx(0.16, abs=0.003)
    assert size > 0.35


def test_a_clip_on_one_side_does_not_bend_the_line():
    place = np.linspace(0, 0.1, 60)
    centre = 0.1 * place + 0.002 + np.where(place < 0.03, 0.003, 0.0)
    slope, height = straight_line(place, centre)
    assert slope == pytest.approx(0.1, abs=0.01)
    assert height == pytest.approx(0.002, abs=5e-4)
