"""Boxes around the parts of furniture."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np

from manipose_mj.assets.asset import MODEL_FILE
from manipose_mj.assets.catalogue import load
from manipose_mj.tasks.articulated.part_shape import part_shape


def test_what_touches_counts_whatever_its_group(tmp_path):
    asset = load("cabinet", 0)
    shutil.copytree(asset.folder, tmp_path / "cabinet")
    edited = tmp_path / "cabinet" / MODEL_FILE
    text = edited.read_text()
    assert 'group="3"' in text
    edited.write_text(text.replace('group="3"', 'group="0"'))
    part = next(part for part in asset.parts if part.handle is not None)
    one, other = (part_shape(each, part) for each in (asset, replace(asset, folder=edited.parent)))
    for name in ("fixed", "beside", "moving", "floor"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
