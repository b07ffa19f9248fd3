"""The clouds that the pose commands work on, rendered with progress on the terminal."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import joblib

from manipose_mj.assets.asset import Asset
from manipose_mj.assets.categories import CATALOGUE, Split
from manipose_mj.console import output
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.ppf_jax.data.asset_views import asset_whole, chosen_assets, views_of
from manipose_mj.ppf_jax.data.part_swap_clouds import asset_part_swap_clouds, part_swap_clouds
from manipose_mj.ppf_jax.data.source_frames import SourceLabel, with_source_frames
from manipose_mj.ppf_jax.data.view_cache import catalogue_clouds, source_labels
from manipose_mj.ppf_jax.data.view_settings import view_setting
from manipose_mj.ppf_jax.evaluation.pose_predictions import categories_of
from manipose_mj.ppf_jax.points.cloud_files import read_views
from manipose_mj.ppf_jax.points.clouds import LabelledCloud
from manipose_mj.ppf_jax.points.symmetry import CommonSymmetry

log = logging.getLogger(__name__)


class PoseClouds:
    """Views of a category's, or a type's, objects."""

    def __init__(
        self,
        name: str,
        *,
        leave_out: Sequence[str] = (),
        labels: Literal["unified", "original"] = "unified",
        jobs: int = 1,
    ) -> None:
        """Choose the categories.

        Args:
          name: A category or a type.
          leave_out: Categories of the type to do without.
          labels: The unified ones, or those of the sources that objects are assigned to.
          jobs: Processes that render.

        Raises:
          InputError: There is no such category or type, or nothing is left.
        """
        known = categories_of(name)
        self._name = name
        for category in leave_out:
            if category not in known:
                raise unknown_name(f"category of {name}", category, known)
        self.categories = tuple(c for c in known if c not in leave_out)
        if not self.categories:
            raise InputError(f"--leave-out leaves nothing of {name}")
        self._leave_out = frozenset(leave_out)
        self._labels = labels
        self._jobs = jobs

    def objects(self, split: Split) -> int:
        """How many objects are in a split."""
        rows = [CATALOGUE[category] for category in self.categories]
        return sum(row.split(i) == split for row in rows for i in range(row.instances))

    def rendered(self, split: Split, setting: str, views: int) -> list[LabelledCloud]:
        """Views of every object in a split."""
        clouds: list[LabelledCloud] = []
        total, before = self.objects(split), 0
        chosen = view_setting(setting)
        with output.Progress(f"{split} objects rendered") as progress:

            def show(done: int, _: int, name: str) -> None:
                progress.update(before + done, total, name)

            for category in self.categories:
                clouds += catalogue_clouds(
                    category, split, chosen, views=views, jobs=self._jobs, progress=show
                )
                before += self._objects_of(category, split)
        if self._labels == "original":
            return with_source_frames(clouds, self.sources(clouds))
        return clouds

    def part_swapped(self, count: int, setting: str = "training") -> list[LabelledCloud]:
        """Views of objects that are made of two training objects each.

        Raises:
          InputError: They are wanted with the sources' labels, which they have none of; or of fewer
            than two categories.
        """
        if not count:
            return []
        if self._labels == "original":
            raise InputError(
                "--part-swaps makes objects that no source has; leave out --labels original"
            )
        with output.Progress("part-swapped objects rendered") as progress:
            return part_swap_clouds(
                self.categories,
                count,
                view_setting(setting),
                jobs=self._jobs,
                progress=progress.update,
            )

    def of_scans(self, folders: Sequence[Path], known: CommonSymmetry) -> list[LabelledCloud]:
        """The views in folders of `read_views` of what is of the category, or of the type, and has `known`.

        Raises:
          InputError: They are wanted with the sources' labels, a folder has no views or damaged ones, or nothing in
            all folders is of the category or type, not left out, and has the symmetry.
        """
        if not folders:
            return []
        if self._labels == "original":
            raise InputError(
                "--scan-views have unified labels only; leave out --labels original or --scan-views"
            )
        scans = [scan for folder in folders for scan in read_views(folder)]
        clouds = [
            cloud
            for scan in scans
            if self._name in (scan.category, scan.object_type)
            and scan.category not in self._leave_out
            and known.holds(scan.symmetry)
            for cloud in scan.clouds
        ]
        if not clouds:
            raise InputError(
                f"{folders[0]}: none of {len(scans)} scans is of {self._name}, not left out and as symmetric as "
                "the catalogue's objects; leave out --scan-views"
            )
        return clouds

    def fitting_assets(
        self, directories: Sequence[Path], known: CommonSymmetry
    ) -> tuple[Asset, ...]:
        """The built assets of these categories, or of the type, in folders.

        What has less symmetry than the catalogue's objects share is left out with a warning, for no network that
        assumes it can learn it.

        Args:
          directories: Of asset folders.
          known: What the catalogue's objects share.

        Raises:
          InputError: They are wanted with the sources' labels, a folder has no asset of the category or type, one
            cannot be read, all are left out, or none has the symmetry.
        """
        if not directories:
            return ()
        if self._labels == "original":
            raise InputError(
                "--assets have unified labels only; leave out --labels original or --assets"
            )
        found = [
            asset
            for folder in directories
            for asset in chosen_assets(folder, self._name)
            if asset.category not in self._leave_out
        ]
        if not found:
            raise InputError(f"{directories[0]}: --leave-out leaves no asset of {self._name}")
        fitting = tuple(asset for asset in found if known.holds(asset.label.symmetry))
        for asset in found:
            if asset not in fitting:
                log.warning("%s: less symmetric than what is trained, left out", asset.folder)
        if not fitting:
            raise InputError(
                f"{directories[0]}: no asset has the symmetry of the catalogue's {self._name} objects"
            )
        return fitting

    def of_assets(self, assets: Sequence[Asset], setting: str, views: int) -> list[LabelledCloud]:
        """`views` views of each of some built assets.

        Raises:
          InputError: One cannot be read, or not be seen in this setting.
        """
        chosen = view_setting(setting)
        work = joblib.Parallel(n_jobs=self._jobs, return_as="generator")(
            joblib.delayed(views_of)(asset, chosen, views) for asset in assets
        )
        clouds: list[LabelledCloud] = []
        with output.Progress("assets rendered") as progress:
            for done, (asset, some) in enumerate(zip(assets, work, strict=True), 1):
                clouds += some  # pyright: ignore[reportOperatorIssue]
                progress.update(done, len(assets), asset.name)
        return clouds

    def part_swapped_assets(self, assets: Sequence[Asset], count: int) -> list[LabelledCloud]:
        """Views of objects that are made of an asset and another object, as training sees them.

        Raises:
          InputError: There is no asset, or none whose ends can be told apart.
        """
        if not count:
            return []
        if not assets:
            raise InputError("--asset-part-swaps makes objects of assets; name some with --assets")
        with output.Progress("part-swapped assets rendered") as progress:
            return asset_part_swap_clouds(
                [asset_whole(asset) for asset in assets],
                self.categories,
                count,
                view_setting("training"),
                jobs=self._jobs,
                progress=progress.update,
            )

    def sources(self, clouds: Sequence[LabelledCloud]) -> dict[str, SourceLabel]:
        """The sources' labels of the objects that clouds show."""
        return source_labels(clouds, jobs=self._jobs)

    def _objects_of(self, category: str, split: Split) -> int:
        row = CATALOGUE[category]
        return sum(row.split(i) == split for i in range(row.instances))
