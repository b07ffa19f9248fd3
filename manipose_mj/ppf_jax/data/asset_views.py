"""Clouds of built assets, such as real scans: as they are, and for training with changes of their shape."""

from __future__ import annotations

import zlib
from pathlib import Path

import joblib
import numpy as np

from manipose_mj.assets.asset import Asset
from manipose_mj.assets.asset_json import list_assets, read_asset
from manipose_mj.assets.visible_shapes import surface, visible_shapes
from manipose_mj.errors import InputError
from manipose_mj.poses import SymmetryGroup
from manipose_mj.ppf_jax.data.augmentation.part_swap import Whole
from manipose_mj.ppf_jax.data.augmentation.tapering import taperable, tapered
from manipose_mj.ppf_jax.data.rendering import Subject, render_clouds
from manipose_mj.ppf_jax.data.view_cache import VIEWS_PER_FILE
from manipose_mj.ppf_jax.data.view_settings import ViewSetting
from manipose_mj.ppf_jax.points.clouds import LabelledCloud


def asset_clouds(
    directory: Path, name: str, setting: ViewSetting, *, views: int, jobs: int = 1
) -> list[LabelledCloud]:
    """Views of the rigid assets in a folder that are of a category or a type.

    Args:
      directory: Of asset folders.
      name: A category, or a labelling rule such as `"axial"`.
      setting: From where, and how well; without occluders.
      views: Of each asset.
      jobs: Processes.

    Raises:
      InputError: There is no such asset in the folder, or one cannot be read.
    """
    rendered = joblib.Parallel(n_jobs=jobs)(
        joblib.delayed(views_of)(asset, setting, views) for asset in chosen_assets(directory, name)
    )
    return [cloud for clouds in rendered for cloud in clouds]  # pyright: ignore[reportOptionalIterable, reportGeneralTypeIssues]


def chosen_assets(directory: Path, name: str) -> list[Asset]:
    """The rigid assets in a folder that are of a category or a type.

    Raises:
      InputError: There is no such asset in the folder, or one cannot be read.
    """
    chosen = [
        asset
        for asset in map(read_asset, list_assets(directory))
        if asset.kind == "rigid" and name in (asset.category, asset.label.object_type)
    ]
    if not chosen:
        raise InputError(f"{directory}: no rigid asset of category or type {name!r}")
    return chosen


def textured_groups(directory: Path) -> dict[str, SymmetryGroup]:
    """The symmetry group of shape and print of every rigid asset in a folder, by its name.

    Raises:
      InputError: There is no asset in the folder, or one cannot be read.
    """
    assets = map(read_asset, list_assets(directory))
    return {asset.name: asset.label.symmetry_textured for asset in assets if asset.kind == "rigid"}


def asset_whole(asset: Asset) -> Whole:
    """What is seen of a built rigid asset, in one mesh.

    Raises:
      InputError: Its model or a mesh cannot be read.
    """
    return Whole(surface(visible_shapes(asset.folder)), asset.label)


def asset_subject(asset: Asset, *, taper: float = 0.0) -> Subject:
    """A built rigid asset, ready to be rendered.

    Args:
      asset: Of a folder.
      taper: How much wider its upper end is drawn than it is, as a share; of what can be tapered
        (`tapering.py`). Its resting poses are those of the asset as it is.

    Raises:
      InputError: Its model or a mesh cannot be read.
    """
    visible = visible_shapes(asset.folder)
    whole, label = surface(visible), asset.label
    shapes = [shape for own in visible.values() for shape in own]
    if taper and taperable(label):
        (whole, label), shapes = tapered(whole, label, taper), []
    return Subject.of_mesh(
        whole,
        label,
        name=asset.name,
        category=asset.category,
        shapes=shapes,
        rests=[(pose.rotation, pose.height, pose.probability) for pose in asset.stable_poses],
    )


def views_of(asset: Asset, setting: ViewSetting, views: int) -> list[LabelledCloud]:
    """Views of one asset, the same whenever it is rendered; occluded by nothing but boxes.

    Where the setting tapers, every `VIEWS_PER_FILE` views are of another taper.

    Raises:
      InputError: Its model or a mesh cannot be read, or it cannot be seen in this setting.
    """
    seed = zlib.crc32(asset.name.encode())
    if not setting.taper:
        rng = np.random.default_rng(seed)
        return render_clouds(asset_subject(asset), setting, views, rng)
    clouds: list[LabelledCloud] = []
    for first in range(0, views, VIEWS_PER_FILE):
        rng = np.random.default_rng([seed, first])
        subject = asset_subject(asset, taper=rng.uniform(-setting.taper, setting.taper))
        count = min(VIEWS_PER_FILE, views - first)
        clouds += render_clouds(subject, setting, count, rng, first=first)
    return clouds
