"""PartNet-Mobility's layout in one's own furniture: what is no part named handle, and still opens a drawer or a door."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from asset_pipeline.build.articulated import build_articulated
from asset_pipeline.sources.partnet_mobility import objects as partnet_mobility
from manipose_mj.assets.asset import Asset
from tests.asset_pipeline.sources.drawn_boards import Boards, board_visuals

# z up and the front towards -x, no unit: name of the part, lowest and highest corner.
BASE: Boards = [
    ("wall-1", (-0.5, -0.5, 0.0), (0.5, -0.46, 1.0)),
    ("wall-2", (-0.5, 0.46, 0.0), (0.5, 0.5, 1.0)),
    ("bottom-3", (-0.5, -0.46, 0.0), (0.5, 0.46, 0.04)),
]
FRONT, BOX = ((-0.54, -0.5, 0.0), (-0.5, 0.5, 0.5)), ((-0.5, -0.4, 0.1), (0.4, 0.4, 0.14))
BALL, POST = ((-0.66, -0.04, 0.2), (-0.58, 0.04, 0.28)), ((-0.6, -0.015, 0.22), (-0.54, 0.015, 0.26))  # fmt: skip
BAR = ((-0.64, -0.2, 0.22), (-0.61, 0.2, 0.26))
POSTS = [((-0.61, y, 0.225), (-0.54, y + 0.03, 0.255)) for y in (-0.15, 0.12)]
DRAWER: Boards = [("front-4", *FRONT), ("box-5", *BOX)]
KINDS = {"slider": ("prismatic", "1 0 0", -0.6, 0), "hinge": ("revolute", "0 0 1", 0, 1.5)}


def _drawn(folder: Path, links: dict[str, tuple[str, str, Boards]]) -> Path:
    """A folder with a base and links, by name: what they hang on, how they move and their boards."""
    texts = ['<link name="root"/>']
    joints = ['<joint name="j" type="fixed"><parent link="root"/><child link="base"/></joint>']
    for link, (parent, motion, boards) in {"base": ("", "", BASE), **links}.items():
        texts.append(f'<link name="{link}">{board_visuals(folder, link, boards)}</link>')
        if parent:
            kind, axis, lower, upper = KINDS[motion]
            joints.append(
                f'<joint name="{link}" type="{kind}"><parent link="{parent}"/><child link="{link}"/>'
                f'<axis xyz="{axis}"/><limit lower="{lower}" upper="{upper}"/></joint>'
            )
    (folder / "mobility.urdf").write_text(
        f'<robot name="r">{"".join(texts)}{"".join(joints)}</robot>'
    )
    (folder / "semantics.txt").write_text("base heavy furniture_body\nlink_1 slider drawer\n")
    (folder / "meta.json").write_text(json.dumps({"model_cat": "StorageFurniture"}))
    return folder


def _built(folder: Path, more: Boards, **links: tuple[str, str, Boards]) -> Asset:
    drawer = ("base", "slider", [*DRAWER, *more])
    (item,) = partnet_mobility.items(_drawn(folder / "chest", {"link_1": drawer, **links}))
    with partnet_mobility.opened(item) as scan:
        return build_articulated(scan, folder / "built")


def test_a_knob_that_belongs_to_a_drawer_is_its_handle(tmp_path):
    named = _built(tmp_path / "handle", [("handle-22", *BALL), ("handle-22", *POST)])
    asset = _built(tmp_path / "knob", [("knob-22", *BALL), ("knob-22", *POST)])
    handle, expected = asset.part("drawer_1").handle, named.part("drawer_1").handle
    assert handle is not None and expected is not None
    np.testing.assert_allclose(handle.rotation, expected.rotation, atol=1e-9)
    np.testing.assert_allclose(handle.extents, expected.extents, atol=1e-6)
    np.testing.assert_allclose(handle.origin, expected.origin, atol=1e-6)


def test_a_knob_that_turns_on_a_drawer_is_no_handle(tmp_path):
    lock = ("link_1", "hinge", [("knob-22", *BALL), ("knob-22", *POST)])
    assert _built(tmp_path, [], link_2=lock).part("drawer_1").handle is None


@pytest.mark.parametrize(
    "more",
    [
        [],
        [("handle-22", *BALL), ("handle-22", *POST)],
        [("knob-22", *BALL), ("knob-23", *POST)],
        [("knob-22", *BALL), ("post-23", *POST)],
        [("front-4", *BALL), ("front-4", *POST)],
        [("piece-22", *BAR), *(("front-4", *post) for post in POSTS)],
    ],
    ids=["none", "named", "knob", "post", "one with the front", "bar"],
)
def test_a_handle_is_no_depth_of_furniture(tmp_path, more):
    drawer = ("base", "slider", [*DRAWER, *more])
    (item,) = partnet_mobility.items(_drawn(tmp_path / "chest", {"link_1": drawer}))
    with partnet_mobility.opened(item) as scan:
        (opened,) = scan.moving
        width = np.ptp([p.mesh.bounds for p in scan.base.parts], axis=(0, 1))[1]
    assert opened.joint is not None
    assert width == pytest.approx(0.42 / 1.04)  # with its front the chest is 1.04 deep, and 1 wide
    assert opened.joint.travel == pytest.approx(0.6 * 0.42 / 1.04)
