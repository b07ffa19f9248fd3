"""An asset whose two files contradict each other does not pass, and one line says where."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from asset_pipeline.build.emit import write_asset
from asset_pipeline.checks.asset_check import check_asset
from asset_pipeline.geometry.mass import shape_mass_properties
from manipose_mj.assets.asset import Asset, MovingPart, Provenance, StablePose
from manipose_mj.assets.geometry import Body, Joint, Shape
from manipose_mj.assets.label import PoseLabel
from manipose_mj.poses import SymmetryGroup, compose

LABEL = PoseLabel(
    np.zeros(3), np.eye(3), "mirror", np.array([0.04, 0.06, 0.08]), SymmetryGroup.three_planes()
)
HINGE = Joint("hinge", np.array([-0.1, 0.1, 0.0]), np.array([0.0, 0, 1]), (0.0, 1.5), 0.2, 0.3)
SLIDE = Joint("slide", np.zeros(3), np.array([-1.0, 0, 0]), (0.0, 0.1), 2.0, 5.0)


def _box(folder, **changes) -> Asset:
    box = Shape("box", (0.02, 0.03, 0.04))
    body = Body("box", (box,), (box,), shape_mass_properties((box,), 500.0))
    asset = Asset(
        folder,
        "box",
        "rigid",
        "box",
        LABEL,
        np.array([0.0, 0, 1]),
        body.mass_properties,
        (StablePose(np.eye(3), 0.04, 1.0),),
        Provenance("test", "box", "none"),
    )
    return write_asset(asset, (replace(body, **changes),))


def _cupboard(folder) -> Asset:
    """A cube with a door on a hinge and, above it, a slide."""
    board, box = (0.01, 0.1, 0.05), Shape("box", (0.08, 0.1, 0.1))
    parts, bodies = [], [Body("base", (box,), (box,), shape_mass_properties((box,), 500.0))]
    for name, joint, height in (("door", HINGE, -0.05), ("flap", SLIDE, 0.06)):
        front = Shape("box", board, compose(np.eye(3), np.array([-0.11, 0, height])))
        mass = shape_mass_properties((front,), 500.0)
        others = tuple(b.name for b in bodies)
        bodies.append(Body(name, (front,), (front,), mass, joint=joint, excluded=others))
        parts.append(MovingPart(name, joint, None, None))
    asset = replace(
        _box(folder), kind="articulated", name="cupboard", stable_poses=(), parts=tuple(parts)
    )
    return write_asset(asset, tuple(bodies))


def _with(asset: Asset, *keys, value) -> tuple[str, ...]:
    """What the check says with one value of `asset.json` changed."""
    path = asset.folder / "asset.json"
    document = json.loads(path.read_text())
    place = document
    for key in keys[:-1]:
        place = place[key]
    place[keys[-1]] = value
    path.write_text(json.dumps(document))
    return check_asset(asset.folder).failures


def test_files_that_agree_pass(tmp_path):
    assert check_asset(_box(tmp_path / "box").folder).failures == ()
    assert check_asset(_cupboard(tmp_path / "cupboard").folder).failures == ()


def test_a_part_without_a_joint_of_its_name_is_told(tmp_path):
    renamed = _with(_cupboard(tmp_path / "thing"), "parts", 0, "name", value="gate")
    assert renamed == (
        "asset.json has a part 'gate', but model.xml no joint of that name; its joints: 'door', 'flap'",
        "model.xml has a joint 'door', but asset.json no part of that name; its parts: 'gate', 'flap'",
    )


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("type", "slide", "joint 'door' is a slide in asset.json, but a hinge joint in model.xml"),
        ("axis", [0, 0, -1], r"'door': its axis is \(0, 0, -1\) in asset.json, but \(0, 0, 1\)"),
        ("origin", [-0.1, 0.2, 0], "'door': its place is"),
        ("range", [0, 90], r"'door': its range is \(0, 90\) in asset.json, but \(0, 1.5\)"),
    ],
)
def test_a_joint_that_differs_is_told(tmp_path, key, value, message):
    (failure,) = _with(_cupboard(tmp_path / "thing"), "parts", 0, "joint", key, value=value)
    assert re.search(message, failure)


def test_any_point_on_an_axis_will_do(tmp_path):
    hinge = _with(_cupboard(tmp_path / "a"), "parts", 0, "joint", "origin", value=[-0.1, 0.1, 0.3])
    slide = _with(_cupboard(tmp_path / "b"), "parts", 1, "joint", "origin", value=[0.1, 0.1, 0.3])
    assert hinge == slide == ()


def test_another_mass_or_centre_is_told(tmp_path):
    (heavy,) = _with(_box(tmp_path / "a"), "mass_properties", "mass", value=1.92)
    assert heavy == "weighs 1.92 kg in asset.json, but 0.096 kg in model.xml"
    (off,) = _with(_box(tmp_path / "b"), "mass_properties", "center_of_mass", value=[0, 0, 0.002])
    assert off == "its centre of mass is (0, 0, 0.002) in asset.json, but (0, 0, 0) in model.xml"


def test_an_object_that_nobody_sees_is_told(tmp_path):
    (failure,) = check_asset(_box(tmp_path / "box", visual=()).folder).failures
    assert "nothing to be seen" in failure


def test_a_label_far_from_its_object_is_told(tmp_path):
    (failure,) = _with(_box(tmp_path / "a"), "label", "origin", value=[1, 2, 3])
    assert failure.startswith("origin of the label is 3.") and "m off the object" in failure
    assert _with(_box(tmp_path / "b"), "label", "origin", value=[0, 0, 0.2]) == ()
