"""`manipose pose evaluate`: how far an estimator is off, category by category."""

from __future__ import annotations

import sys
from collections.abc import Collection, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import arg

from manipose_mj.cli.pose.train import Name
from manipose_mj.console.process import CORES, compile_at_once_on_gpus, prepare_workers
from manipose_mj.errors import InputError

if TYPE_CHECKING:
    from manipose_mj.ppf_jax.points.clouds import LabelledCloud

KEPT = 0.8  # share of the views that the estimator is surest of


def evaluate_pose(
    name: Name,
    /,
    *,
    weights: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None,
    labels: Literal["unified", "original"] = "unified",
    setting: str = "anywhere",
    split: Literal["train", "test"] = "test",
    assets: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="")] = None,
    views: int = 32,
    jobs: int = CORES,
    json: bool = False,
    estimator: Annotated[
        str | None, arg(metavar="MODULE:FACTORY|ws://HOST:PORT", help_behavior_hint="")
    ] = None,
    estimator_args: Annotated[str | None, arg(metavar="JSON", help_behavior_hint="")] = None,
    give_cad: Annotated[bool, arg(help_behavior_hint="")] = False,
) -> int:
    """Evaluate a pose estimator on rendered views of the catalogue's test objects.

    Errors are the least over each object's symmetry group; in brackets as NOCS counts them, who lets a
    mug turn about its axis while its handle is hidden. Flipped: an error of more than 90 degrees.

    Args:
      name: A category, such as mug; or a type, axial, mirror or functional.
      weights: File that manipose pose train wrote; those of the package without it.
      labels: What the estimator was trained on.
      setting: From where objects are seen: anywhere, resting, tasks, clean, occluded, training; several and
        several_tasks ask the networks that look through several cameras at once.
      split: Of the catalogue.
      assets: Evaluate on the assets in this folder that are of the category or type, such as real
        scans, instead of the catalogue's.
      views: Of each object.
      jobs: Processes that render.
      json: Print JSON, for other programs.
      estimator: Evaluate this one of yours instead: what a factory of a Python module makes, or a server.
      estimator_args: Keyword arguments of its factory, as a JSON object.
      give_cad: Give it the mesh of the very object that is seen.
    """
    prepare_workers(jobs)
    compile_at_once_on_gpus()
    if views < 1:
        raise InputError(f"--views is {views}; expected at least 1")
    import numpy as np
    from rich.table import Table

    from manipose_mj.cli.pose.clouds import PoseClouds
    from manipose_mj.cli.pose.foreign_views import ForeignViews
    from manipose_mj.console import output
    from manipose_mj.estimators.settings import chosen_estimator
    from manipose_mj.ppf_jax.data.asset_views import asset_clouds, textured_groups
    from manipose_mj.ppf_jax.data.view_settings import view_setting
    from manipose_mj.ppf_jax.estimator import PoseEstimator
    from manipose_mj.ppf_jax.evaluation.pose_metrics import most_confident, pose_errors, summary
    from manipose_mj.ppf_jax.evaluation.pose_predictions import catalogue_hulls, predict
    from manipose_mj.ppf_jax.fused_views import FusedViewEstimator

    several = view_setting(setting).cameras != (1, 1)
    foreign = chosen_estimator(estimator, estimator_args, give_cad)
    if foreign is not None and (weights is not None or labels == "original"):
        raise InputError("--weights and --labels are of the package's estimator; leave them out")
    if foreign is not None:
        with redirect_stdout(sys.stderr):  # what a stranger's code prints is no table, nor JSON
            own, asked = None, ForeignViews(foreign, setting, views)
    elif weights is None:
        if labels == "original":
            raise InputError("the package's weights are of unified labels; give --weights FILE")
        cameras = "several" if several else "one"
        own, asked = PoseEstimator.load(name, cameras=cameras), None
    else:
        own, asked = PoseEstimator.from_file(weights, labels=labels), None
    if own is not None and several != (own.trained.cameras == "several"):
        raise InputError(
            f"weights of networks that look through {own.trained.cameras}, setting {setting!r} of "
            f"{'several' if several else 'one'}; choose another setting or other weights"
        )
    method = own.trained.method if own is not None else str(estimator)
    rows = []
    categories = (name,) if assets is not None else PoseClouds(name).categories
    for category in categories:
        frames = hulls = textured = None
        if assets is not None and labels == "original":
            raise InputError("--assets have unified labels only; leave out --labels original")
        if asked is not None:
            with redirect_stdout(sys.stderr):
                clouds, found = asked.predictions(category, split, assets)
        elif assets is not None:
            clouds = asset_clouds(assets, name, view_setting(setting), views=views, jobs=jobs)
        else:
            source = PoseClouds(category, jobs=jobs)
            clouds = source.rendered(split, setting, views)
            if labels == "original":
                frames = source.sources(clouds)
        if assets is not None:
            textured = textured_groups(assets)
        elif labels == "unified" and not view_setting(setting).taper:
            hulls = catalogue_hulls(clouds)  # of objects as they are, not as tapers draw them
        if own is not None:
            found = predict(FusedViewEstimator(own) if several else own, clouds)
        errors = pose_errors(found.poses, clouds, sources=frames, hulls=hulls, textured=textured)
        sure = summary(errors.of(most_confident(found.confidence, KEPT)))
        figures = {k: v for k, v in summary(errors).items() if not np.isnan(v)}
        rows.append(
            {
                "category": category,
                "method": method,
                "given_cad": give_cad,
                "setting": setting,
                "labels": labels,
                **figures,
                "confident_deg_mean": sure["deg_mean"],
                "ms_per_object": found.ms_per_object,
                "trained_on": None if own is None else _trained_on(own.trained.categories, clouds),
            }
        )
    if json:
        output.write_json(rows)
        return 0
    given = ", given CAD" if give_cad else ""
    table = Table("category", title=f"{method}{given}, {setting}, {labels} labels")
    heads = (
        "n",
        "cm",
        "median",
        "deg",
        "median",
        "with print",
        "flipped",
        "5 deg 2 cm",
        "10 deg 5 cm",
    )
    for head in (*heads, f"deg of surest {KEPT:.0%}", "ms"):
        table.add_column(head, justify="right")
    for row in rows:
        table.add_row(
            row["category"] + (" (unseen)" if row["trained_on"] is False else ""),
            str(row["n"]),
            f"{row['origin_cm_mean']:.2f}",
            f"{row['origin_cm_median']:.2f}",
            f"{row['deg_mean']:.1f} ({row['nocs_deg_mean']:.1f})",
            f"{row['deg_median']:.1f} ({row['nocs_deg_median']:.1f})",
            f"{row['textured_deg_mean']:.1f} ({row['textured_deg_median']:.1f})",
            f"{row['flipped']:.1%}",
            f"{row['recall_5deg_2cm']:.0%}",
            f"{row['recall_10deg_5cm']:.0%}",
            f"{row['confident_deg_mean']:.1f}",
            f"{row['ms_per_object']:.1f}",
        )
    output.standard_output().print(table)
    return 0


def _trained_on(categories: Collection[str], clouds: Sequence[LabelledCloud]) -> bool | None:
    """Whether networks of these categories know what clouds show; None: some of it."""
    known = {cloud.category in categories for cloud in clouds}
    return known.pop() if len(known) == 1 else None
