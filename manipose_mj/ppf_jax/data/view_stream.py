"""The views behind the clouds of a table, drawn again: the same ones, with all that a camera sees.

Clouds are kept in a cache; images would be a hundred times larger, and are drawn when somebody asks.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from manipose_mj.assets.categories import CATALOGUE, Split
from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.data.asset_views import asset_subject, chosen_assets
from manipose_mj.ppf_jax.data.pictures import Picture, picture
from manipose_mj.ppf_jax.data.rendering import Subject, View, drawn_views
from manipose_mj.ppf_jax.data.view_cache import (
    VIEWS_PER_FILE,
    catalogue_occluders,
    catalogue_subject,
)
from manipose_mj.ppf_jax.data.view_settings import ViewSetting
from manipose_mj.ppf_jax.points.clouds import LabelledCloud


@dataclass(frozen=True)
class SeenObject:
    """One view of one object.

    Attributes:
      subject: What is seen.
      picture: The whole image.
      cloud: Cut out of it, with its label.
      T_camera_label: The truth, in full precision.
    """

    subject: Subject
    picture: Picture
    cloud: LabelledCloud
    T_camera_label: Float[np.ndarray, "4 4"]


def check_single_views(setting: ViewSetting) -> None:
    """Raise `InputError` where a setting draws objects other than they are, or has several cameras look at once."""
    if setting.cameras != (1, 1):
        raise InputError(f"setting {setting.name!r} has no single views; choose another")
    if setting.taper:
        raise InputError(
            f"setting {setting.name!r} draws objects wider and narrower than they are; choose another"
        )


def split_indices(category: str, split: Split) -> list[int]:
    """The catalogue's objects of a category in a split."""
    row = CATALOGUE[category]
    return [index for index in range(row.instances) if row.split(index) == split]


def catalogue_views(
    category: str, index: int, setting: ViewSetting, views: int
) -> Iterator[SeenObject]:
    """The views of `catalogue_clouds` of one object, in order.

    Raises:
      InputError: The setting draws objects other than they are, or fuses views.
    """
    check_single_views(setting)
    subject = catalogue_subject(category, index, resting=setting.placement != "anywhere")
    stem = zlib.crc32(subject.name.encode())
    occluders = catalogue_occluders(stem) if setting.occluded else []
    for first in range(0, views, VIEWS_PER_FILE):
        rng = np.random.default_rng([stem, first // VIEWS_PER_FILE])
        count = min(VIEWS_PER_FILE, views - first)
        drawn = drawn_views(subject, setting, count, rng, occluders=occluders, first=first)
        yield from (_seen(subject, setting, *each) for each in drawn)


def asset_views(
    directory: Path, name: str, setting: ViewSetting, views: int
) -> Iterator[SeenObject]:
    """The views of `asset_clouds`, in order; arguments and errors as there.

    Raises:
      InputError: The setting draws objects other than they are, or fuses views.
    """
    check_single_views(setting)
    for asset in chosen_assets(directory, name):
        subject = asset_subject(asset)
        rng = np.random.default_rng(zlib.crc32(asset.name.encode()))
        yield from (
            _seen(subject, setting, *each) for each in drawn_views(subject, setting, views, rng)
        )


def _seen(subject: Subject, setting: ViewSetting, view: View, cloud: LabelledCloud) -> SeenObject:
    whole = picture(view, subject, setting, cloud.name)
    return SeenObject(subject, whole, cloud, view.T_camera_mesh @ subject.label.pose)
