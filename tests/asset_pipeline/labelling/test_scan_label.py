"""Labels of made-up axial and mirror objects, moved, leaning and noisy, and their quality."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy.spatial.transform import Rotation
from trimesh.visual import TextureVisuals

from asset_pipeline.labelling.scan_label import scan_label
from manipose_mj.errors import InputError
from manipose_mj.poses import rotation_about

UP = np.array([0.0, 0.0, 1.0])
LEAN = rotation_about(np.array([0.6, -0.8, 0.0]), np.deg2rad(8)) @ rotation_about(UP, 2.1)


def _scan_of(mesh: trimesh.Trimesh, turn: np.ndarray = LEAN) -> trimesh.Trimesh:
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, 0.004)[:2]
    noise = np.random.default_rng(0).normal(0, 0.0005, vertices.shape)
    return trimesh.Trimesh(vertices @ turn.T + [0.1, 0.0, -0.2] + noise, faces, process=False)


def _block(low: list[float], high: list[float]) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[low, high])


def _mug() -> trimesh.Trimesh:
    """The handle along +x."""
    body = trimesh.creation.cylinder(0.04, 0.1)
    handle = _block([0.035, -0.006, -0.03], [0.075, 0.006, 0.03])
    inside = trimesh.creation.cylinder(0.036, 0.1).apply_translation([0, 0, 0.005])
    return trimesh.boolean.difference([trimesh.boolean.union([body, handle]), inside])


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.rad2deg(np.arccos(np.clip(a @ b, -1, 1))))


def test_a_leaning_cone_gets_its_own_axis_and_keeps_its_ends_apart():
    outline = np.array([(0, 0), (0.03, 0), (0.045, 0.1), (0, 0.1)])
    label, quality = scan_label(
        _scan_of(trimesh.creation.revolve(outline, sections=64)), "axial", UP, textured=False
    )
    assert _angle(label.rotation[:, 0], LEAN @ UP) < 0.3
    assert label.symmetry.axial and len(label.symmetry.rotations) == 1
    np.testing.assert_allclose(label.extents, [0.1, 0.09, 0.09], atol=3e-3)
    np.testing.assert_allclose(label.origin, LEAN @ [0, 0, 0.05] + [0.1, 0, -0.2], atol=1e-3)
    assert quality.confidence > 0.9
    assert quality.residuals["axis"] < 0.001 < 0.01 < quality.residuals["flip"]


def test_a_box_that_is_said_to_be_axial_is_laid_like_a_box():
    label, quality = scan_label(trimesh.creation.box(extents=[0.04, 0.06, 0.1]), "axial", UP)
    assert label.object_type == "axial" and not label.symmetry.axial
    assert _angle(np.abs(label.rotation[:, 1]), np.array([0, 1.0, 0])) < 0.5
    assert quality.confidence == 1.0  # of a data set's category; its planes are clear


@pytest.mark.parametrize(
    ("solid", "least", "most"),
    [
        (trimesh.creation.box(extents=[0.04, 0.06, 0.1]), 0.0, 0.1),
        (trimesh.creation.cylinder(0.03, 0.1, sections=64), 0.9, 1.0),
    ],
    ids=["box", "cylinder"],
)
def test_an_axis_that_a_person_states_and_the_shape_lacks_leaves_no_confidence(solid, least, most):
    _, quality = scan_label(_scan_of(solid), "axial", UP, textured=False, type_checked=True)
    assert least <= quality.confidence <= most


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("extents", "members"),
    [((0.04, 0.06, 0.1), 4), ((0.06, 0.06, 0.1), 8)],
)
def test_a_box_lies_along_its_sides(extents, members):
    label, quality = scan_label(_scan_of(trimesh.creation.box(extents=extents)), "mirror", UP)
    assert len(label.symmetry.rotations) == members and not label.symmetry.axial
    np.testing.assert_allclose(label.extents, sorted(extents)[::-1], atol=2.5e-3)
    assert np.linalg.det(label.rotation) == pytest.approx(1)
    assert _angle(label.rotation[:, 0], LEAN @ UP) < 0.5
    assert {"plane", "second_plane", "half_turn"} <= set(quality.residuals)


@pytest.mark.sample(1)
@pytest.mark.parametrize("lying", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_a_boxs_axes_go_by_its_lengths_however_it_lies(lying):
    extents = np.array([0.11, 0.07, 0.045])[list(lying)]
    label, _ = scan_label(_scan_of(trimesh.creation.box(extents=extents)), "mirror", UP)
    np.testing.assert_allclose(label.extents, [0.11, 0.07, 0.045], atol=2.5e-3)
    longest = LEAN[:, int(np.argmax(extents))]
    assert abs(label.rotation[:, 0] @ longest) > np.cos(np.deg2rad(0.5))
    assert np.linalg.det(label.rotation) == pytest.approx(1)
    assert len(label.symmetry.rotations) == 4


def test_a_square_slabs_quarter_turns_follow_its_axes_and_a_notebook_keeps_x_across_its_covers():
    slab = _scan_of(trimesh.creation.box(extents=[0.09, 0.09, 0.03]))
    label, _ = scan_label(slab, "mirror", UP)
    assert abs(label.rotation[:, 2] @ LEAN @ UP) > np.cos(np.deg2rad(0.5))
    quarter = rotation_about(np.array([0.0, 0.0, 1.0]), np.pi / 2)
    assert len(label.symmetry.rotations) == 8
    assert np.abs(label.symmetry.rotations - quarter).max(axis=(1, 2)).min() < 1e-9
    book, _ = scan_label(slab, "mirror", UP, category="notebook")
    assert abs(book.rotation[:, 0] @ LEAN @ UP) > np.cos(np.deg2rad(0.5))


@pytest.mark.sample(4)
@pytest.mark.parametrize(
    ("solid", "members"),
    [
        (trimesh.creation.cylinder(0.008, 0.3), 2),
        (trimesh.creation.cylinder(0.04, 0.01), 2),  # shorter than wide
        (trimesh.creation.cylinder(0.03, 0.052), 2),  # spread alike along all axes
        (trimesh.creation.cone(0.035, 0.09), 1),
    ],
    ids=["rod", "coin", "plug", "cone"],
)
@pytest.mark.parametrize("lying", [0, 1, 2])
def test_a_body_of_revolution_has_its_axis_however_it_lies(solid, members, lying):
    mesh = trimesh.Trimesh(solid.vertices @ np.roll(LEAN, lying, axis=1).T, solid.faces)
    axis = LEAN[:, (2 - lying) % 3]
    label, quality = scan_label(mesh, "mirror", UP, textured=False)
    assert label.symmetry.axial and len(label.symmetry.rotations) == members
    assert abs(label.rotation[:, 0] @ axis) > np.cos(np.deg2rad(0.5))
    if members == 1:
        assert label.rotation[:, 0] @ axis > 0  # towards its tip
    np.testing.assert_allclose(label.extents[0], np.ptp(solid.vertices[:, 2]), atol=2e-3)
    assert quality.confidence > 0.9


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    "solid",
    [
        trimesh.creation.box([0.01, 0.01, 0.3]),  # its corners are within the strict tolerance
        trimesh.creation.cylinder(0.008, 0.3, sections=6),
        trimesh.creation.cylinder(0.03, 0.1, sections=8),
    ],
    ids=["square", "hexagon", "octagon"],
)
def test_a_bar_that_lies_is_not_round(solid):
    label, _ = scan_label(
        trimesh.Trimesh(solid.vertices[:, [2, 0, 1]], solid.faces), "mirror", UP, textured=False
    )
    assert not label.symmetry.axial and len(label.symmetry.rotations) == 8


def test_a_mug_stands_on_its_base_and_looks_towards_its_handle():
    label, quality = scan_label(_scan_of(_mug()), "mirror", UP)
    assert _angle(label.rotation[:, 0], LEAN @ UP) < 1
    assert _angle(label.rotation[:, 1], LEAN @ [1, 0, 0]) < 1
    assert len(label.symmetry.rotations) == 1
    assert quality.residuals["plane"] < 0.0015 and quality.residuals["half_turn"] > 0.02


def test_up_is_square_to_the_base_and_not_to_what_else_could_touch_the_floor():
    # A camera: a body on a base, and a lens that ends 4 mm above the floor.
    body = _block([-0.015, -0.06, 0], [0.015, 0.06, 0.08])
    lens = trimesh.creation.cylinder(0.03, 0.05)
    lens.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    lens.apply_translation([0.03, 0, 0.034])
    label, _ = scan_label(_scan_of(trimesh.boolean.union([body, lens])), "mirror", UP)
    assert _angle(label.rotation[:, 0], LEAN @ UP) < 1
    assert _angle(label.rotation[:, 1], LEAN @ [1, 0, 0]) < 1


def test_a_lump_without_a_plane_says_that_it_is_guessed():
    lump = trimesh.util.concatenate(
        [
            trimesh.creation.box(extents=e, transform=trimesh.transformations.translation_matrix(t))
            for e, t in (
                ((0.05, 0.02, 0.03), (0, 0, 0)),
                ((0.01, 0.06, 0.02), (0.03, 0.02, 0.01)),
                ((0.02, 0.02, 0.05), (-0.02, 0.03, 0.03)),
            )
        ]
    )
    assert isinstance(lump, trimesh.Trimesh)
    _, quality = scan_label(lump, "mirror", UP)
    assert quality.confidence < 0.2
    assert quality.residuals["plane"] > 0.003


@pytest.mark.sample(1)
@pytest.mark.parametrize("striped", [False, True])
def test_ends_are_alike_only_where_the_print_is(tmp_path: Path, striped: bool):
    tin = trimesh.creation.cylinder(0.03, 0.1)
    vertices, faces = trimesh.remesh.subdivide_to_size(tin.vertices, tin.faces, 0.01)[:2]
    tin = trimesh.Trimesh(vertices, faces, process=False)
    uv = np.column_stack([np.full(len(vertices), 0.5), vertices[:, 2] / 0.1 + 0.5])
    tin.visual = TextureVisuals(uv=np.clip(uv, 0.01, 0.99))
    image = np.full((64, 8, 3), 200, np.uint8)
    if striped:
        image[:24] = (20, 30, 160)
    texture = tmp_path / "texture.png"
    Image.fromarray(image).save(texture)
    label, _ = scan_label(tin, "axial", UP, textured=True, texture=texture)
    assert len(label.symmetry.rotations) == 2
    assert len(label.symmetry_textured.rotations) == (1 if striped else 2)
    assert label.symmetry_textured.axial
    unread, _ = scan_label(tin, "axial", UP, textured=True)
    assert len(unread.symmetry.rotations) == 2 and len(unread.symmetry_textured.rotations) == 1


def test_bad_questions_are_refused():
    box = trimesh.creation.box(extents=[0.04, 0.06, 0.1])
    with pytest.raises(InputError, match="handle"):
        scan_label(box, "handle", UP)
    with pytest.raises(InputError, match="up"):
        scan_label(box, "mirror", None)


def test_the_label_does_not_depend_on_where_the_mesh_is():
    rng = np.random.default_rng(3)
    turn = rotation_about(UP, 1.0)
    there = _mug()
    here, _ = scan_label(there, "mirror", UP)
    there.vertices = there.vertices @ turn.T + rng.uniform(-1, 1, 3)
    moved, _ = scan_label(there, "mirror", UP)
    between = Rotation.from_matrix(turn @ here.rotation @ moved.rotation.T).magnitude()
    assert np.rad2deg(between) < 0.5


def _knob() -> trimesh.Trimesh:
    """Cut flat along one side."""
    whole = trimesh.creation.cylinder(0.006, 0.014, sections=48)
    side = _block([-0.01, -0.01, -0.01], [0.0042, 0.01, 0.01])
    return trimesh.boolean.intersection([whole, side])


@pytest.mark.parametrize(
    ("mesh", "object_type", "axial", "members"),
    [
        (trimesh.creation.box([0.012, 0.010, 0.008]), "mirror", False, 4),
        (trimesh.creation.box([0.008, 0.008, 0.016]), "mirror", False, 8),
        (trimesh.creation.box([0.008, 0.008, 0.008]), "mirror", False, 24),
        (
            trimesh.creation.revolve([(0, 0), (0.006, 0), (0.0045, 0.02), (0, 0.02)]),
            "axial",
            True,
            1,
        ),
        (_knob(), "axial", False, 2),
    ],
)
def test_symmetries_of_a_drawn_shape_do_not_depend_on_its_size(mesh, object_type, axial, members):
    small, sure = scan_label(mesh, object_type, UP, textured=False)
    assert small.symmetry.axial == axial and len(small.symmetry.rotations) == members
    large, as_sure = scan_label(mesh.copy().apply_scale(10), object_type, UP, textured=False)
    assert large.symmetry.axial == axial and len(large.symmetry.rotations) == members
    np.testing.assert_allclose(10 * small.extents, large.extents, rtol=1e-3)
    np.testing.assert_allclose(10 * small.origin, large.origin, atol=2e-4)
    np.testing.assert_allclose(small.rotation[:, 0], large.rotation[:, 0], atol=1e-3)
    for name, value in as_sure.residuals.items():
        assert 10 * sure.residuals[name] == pytest.approx(value, abs=2e-4)


def test_a_small_scan_keeps_the_symmetries_that_its_noise_hides():
    label, _ = scan_label(_scan_of(_block([-0.01] * 3, [0.01] * 3), np.eye(3)), "mirror", UP)
    assert len(label.symmetry.rotations) == 24
