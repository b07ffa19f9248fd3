"""PartNet-Mobility's sliding doors: shut as drawn, opening along their front, with a handle that faces away from it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from asset_pipeline.build.articulated import build_articulated
from asset_pipeline.checks.asset_check import check_asset
from asset_pipeline.sources.partnet_mobility import objects as partnet_mobility
from manipose_mj.tasks.articulated.part_choice import kind_of
from tests.asset_pipeline.sources.drawn_boards import board_visuals

# z up and the front towards -x, no unit: name of the part, lowest and highest corner.
BASE = [
    ("vertical_side_panel-0", (-0.5, -0.8, -0.6), (0.5, -0.76, 0.6)),
    ("vertical_side_panel-1", (-0.5, 0.76, -0.6), (0.5, 0.8, 0.6)),
    ("top_panel-2", (-0.5, -0.8, 0.56), (0.5, 0.8, 0.6)),
    ("bottom_panel-3", (-0.5, -0.8, -0.6), (0.5, 0.8, -0.56)),
    ("back_panel-4", (0.46, -0.8, -0.6), (0.5, 0.8, 0.6)),
]
# Before the half of the cabinet with y < 0; its bar stands upright.
DOOR = [
    ("cabinet_door_surface-5", (-0.54, -0.8, -0.6), (-0.50, 0.0, 0.6)),
    ("handle-6", (-0.60, -0.75, -0.2), (-0.57, -0.72, 0.2)),
    ("handle-6", (-0.57, -0.75, -0.2), (-0.54, -0.72, -0.17)),
    ("handle-6", (-0.57, -0.75, 0.17), (-0.54, -0.72, 0.2)),
]


def _drawn(folder: Path, limits: tuple[float, float], axis: str) -> Path:
    links = ['<link name="base"/>']
    for link, boards in (("link_0", BASE), ("link_1", DOOR)):
        links.append(f'<link name="{link}">{board_visuals(folder, link, boards)}</link>')
    joints = (
        '<joint name="joint_0" type="fixed"><parent link="base"/><child link="link_0"/></joint>'
        '<joint name="joint_1" type="prismatic"><parent link="link_0"/><child link="link_1"/>'
        f'<axis xyz="{axis}"/><limit lower="{limits[0]}" upper="{limits[1]}"/></joint>'
    )
    (folder / "mobility.urdf").write_text(f'<robot name="r">{"".join(links)}{joints}</robot>')
    (folder / "semantics.txt").write_text(
        "link_0 heavy furniture_body\nlink_1 slider translation_door\n"
    )
    (folder / "meta.json").write_text(json.dumps({"model_cat": "StorageFurniture"}))
    (folder / "mobility_v2.json").write_text("[]")
    return folder


@pytest.mark.parametrize(("limits", "axis"), [((0, 0.7), "0 1 0"), ((-0.7, 0), "0 -1 0")])
def test_a_sliding_door_is_a_door_with_its_handle_in_front(tmp_path, limits, axis):
    (item,) = partnet_mobility.items(_drawn(tmp_path / "4712", limits, axis))
    with partnet_mobility.opened(item) as scan:
        asset = build_articulated(scan, tmp_path / "built")
    (door,) = asset.parts
    assert door.name == "door_1" and kind_of(door) == "sliding door"
    assert door.joint.kind == "slide"
    np.testing.assert_allclose(door.joint.axis, [0, 1, 0], atol=1e-9)
    np.testing.assert_allclose(door.handle.rotation[:, :2].T, [[0, 0, 1], [-1, 0, 0]], atol=1e-9)
    assert door.handle.origin[1] < -0.1  # shut as drawn
    assert door.cavity is not None and not door.cavity.moves_with_part
    assert check_asset(asset.folder).failures == ()
