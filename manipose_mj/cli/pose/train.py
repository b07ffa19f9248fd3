"""`manipose pose train`: an estimator for a category, or for all categories of a type."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import Positional, arg

from manipose_mj.console.process import CORES, compile_at_once_on_gpus, prepare_workers
from manipose_mj.errors import InputError

WEIGHTS_FILE, CURVE_PICTURE = "weights.npz", "curve.png"
SEVERAL = "several"  # the setting of what several cameras see at once
HELD_OUT = "anywhere"  # the setting that the curve's errors are of, as the tables are
Name = Annotated[Positional[str], arg(metavar="CATEGORY|TYPE")]


def train_pose(
    name: Name,
    /,
    *,
    out: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="")] = None,
    leave_out: Annotated[tuple[str, ...], arg(metavar="CATEGORY...")] = (),
    method: Literal["ours", "cppf"] = "ours",
    labels: Literal["unified", "original"] = "unified",
    setting: Annotated[tuple[str, ...], arg(metavar="NAME...")] = ("training",),
    views: int = 256,
    part_swaps: int = 0,
    assets: Annotated[tuple[Path, ...], arg(metavar="DIR...")] = (),
    asset_views: int = 96,
    asset_part_swaps: int = 0,
    scan_views: Annotated[tuple[Path, ...], arg(metavar="DIR...")] = (),
    batch: int = 64,
    steps: int = 20_000,
    minutes: Annotated[float | None, arg(help_behavior_hint="")] = None,
    seed: int = 0,
    start_from: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None,
    jobs: int = CORES,
) -> int:
    """Train a pose estimator on rendered views of the catalogue's training objects.

    Goes on where an interrupted training of the same folder was. Writes the weights, the state to go on
    from, and the curve as JSON and as a picture.

    Args:
      name: A category, such as mug; or a type, axial, mirror or functional: one network for all of
        its categories.
      out: Folder to write to; without it pose/NAME, or pose/NAME-cppf, pose/NAME-original,
        pose/NAME-cppf-original.
      leave_out: Categories of the type that are not trained on, neither their built assets and scans.
      method: Our estimator, or CPPF as published, to compare with; for the latter --batch 8 is enough
        on a CPU.
      labels: The unified labels, or those of the sources that the objects are assigned to.
      setting: From where objects are seen, one or several: training, anywhere, resting, tasks, clean, occluded.
      views: Of each object in each setting.
      part_swaps: Of a type, so many objects besides that are made of two of different categories, 32 views
        each in the setting several if a setting has several cameras, else in training.
      assets: Folders of built assets, such as your scans, that are trained on besides: those of the category or
        type.
      asset_views: Of each of these assets in each setting.
      asset_part_swaps: So many objects besides that are made of one of these assets and another of them or a
        training object, 32 views each in the setting training.
      scan_views: Folders of views that benchmarks/flips/scan_views.py rendered, which are trained on besides: those
        of the category or type.
      batch: Clouds in a step.
      steps: In all.
      minutes: Ends the training, cooled down, if the steps do not.
      seed: Of the first weights and of all that training draws.
      start_from: Weights of an earlier training to start from, instead of random ones; of the same method, and of
        a category where one is trained, else of a type.
      jobs: Processes that render.
    """
    prepare_workers(jobs)
    compile_at_once_on_gpus()
    require_positive(minutes, views=views, **{"asset-views": asset_views}, batch=batch, steps=steps)
    for option, count in (("part-swaps", part_swaps), ("asset-part-swaps", asset_part_swaps)):
        if count < 0:
            raise InputError(f"--{option} is {count}; expected 0 or more")
    from manipose_mj.tasks.core.config import check_seed

    check_seed(seed, "--seed")
    if not setting:
        raise InputError("--setting names none; expected at least one, such as training")
    from manipose_mj.cli.pose.clouds import PoseClouds
    from manipose_mj.console import output
    from manipose_mj.evaluation.protocol.own_assets import built_assets, digest_of
    from manipose_mj.ppf_jax.data.view_cache import batch_stream
    from manipose_mj.ppf_jax.data.view_settings import view_setting
    from manipose_mj.ppf_jax.points.symmetry import common_symmetry
    from manipose_mj.ppf_jax.rigid.model import PoseModel
    from manipose_mj.ppf_jax.rigid.model_sizes import category_config, type_config
    from manipose_mj.ppf_jax.training.curve_picture import draw_curve
    from manipose_mj.ppf_jax.training.loop import CURVE_FILE, Row, train
    from manipose_mj.ppf_jax.training.methods import METHODS
    from manipose_mj.ppf_jax.training.saved_state import check_resumable
    from manipose_mj.ppf_jax.weight_files import TrainedModel, save_weights

    initial = starting_weights(start_from, method)
    source = PoseClouds(name, leave_out=leave_out, labels=labels, jobs=jobs)
    if initial is not None and method == "ours" and not leave_out:
        # As `model_config` will choose, of what is rendered.
        alone = source.categories == (name,) and not asset_part_swaps
        sized = category_config if alone else type_config
        check_sizes(start_from, initial, sized(initial.config.symmetry), PoseModel)
    chosen = METHODS[method]
    training = replace(chosen.training, steps=steps, seed=seed)
    folder = Path("pose") / folder_name(name, method, labels) if out is None else out
    about = {
        "name": name,
        "--leave-out": sorted(leave_out),
        "--labels": labels,
        "--setting": setting,
        "--views": views,
        "--part-swaps": part_swaps,
        "--assets": digest_of(built_assets(assets)),
        "--asset-views": asset_views,
        "--asset-part-swaps": asset_part_swaps,
        "--scan-views": [str(path.absolute()) for path in scan_views],
        "--batch": batch,
        "--start-from": file_digest(start_from),
    }
    check_resumable(folder, training, about)
    several = any(view_setting(each).cameras != (1, 1) for each in setting)
    made_of_two = source.part_swapped(part_swaps, SEVERAL if several else "training")
    clouds = [cloud for each in setting for cloud in source.rendered("train", each, views)]
    clouds += made_of_two
    known = common_symmetry(cloud.symmetry for cloud in clouds)
    scans = source.fitting_assets(assets, known)
    for each in setting:
        clouds += source.of_assets(scans, each, asset_views)
    clouds += source.part_swapped_assets(scans, asset_part_swaps)
    clouds += source.of_scans(scan_views, known)
    # For the curve; nothing is chosen by them.
    checks = -(-chosen.checks // batch)
    held_out = source.rendered(
        "test",
        SEVERAL if several else HELD_OUT,
        1 + checks * batch // source.objects("test"),
    )
    config = chosen.configured(clouds)
    if initial is not None:
        check_sizes(start_from, initial, config, chosen.build)
    stream = batch_stream(held_out, batch, seed, points=config.points)(0)
    feed = batch_stream(clouds, batch, seed, points=config.points)
    with output.Progress("steps") as progress:

        def show(row: Row) -> None:
            error = f", {row['deg_median']:.1f} deg" if "deg_median" in row else ""
            progress.update(int(row["step"]) + 1, steps, f"loss {row['loss']:.3f}{error}")

        model = train(
            feed,
            config,
            training,
            folder,
            build=chosen.build,
            initial=initial,
            about=about,
            held_out=[next(stream) for _ in range(checks)],
            minutes=minutes,
            progress=show,
        )
    if chosen.tuned is not None:
        model = chosen.tuned(model, list(islice(feed(0), checks)))
    cameras = "several" if several else "one"
    save_weights(folder / WEIGHTS_FILE, TrainedModel(model, source.categories, labels, cameras))
    draw_curve(folder / CURVE_FILE, folder / CURVE_PICTURE)
    output.standard_output().print(
        f"trained on {len(clouds)} views of {', '.join(source.categories)}; {folder / WEIGHTS_FILE}",
        soft_wrap=True,
    )
    return 0


def folder_name(name: str, method: str, labels: str) -> str:
    """Where a training is kept if its user does not say."""
    parts = [name]
    parts += [method] if method != "ours" else []
    parts += [labels] if labels != "unified" else []
    return "-".join(parts)


def starting_weights(path: Path | None, method: str) -> Any:
    """The model of an earlier training to start from; None of none.

    Raises:
      InputError: The file is none of weights, or of those of another method.
    """
    if path is None:
        return None
    from manipose_mj.ppf_jax.weight_files import load_weights

    trained = load_weights(path)
    if trained.method != method:
        raise InputError(f"{path}: weights of method {trained.method}; expected {method}")
    return trained.model


def check_sizes(path: Path | None, initial: Any, config: Any, build: Callable[..., Any]) -> None:
    """Raises InputError, with the file that they are of, for weights of other sizes than `build(config)` has."""
    import numpy as np

    from manipose_mj.ppf_jax.training.loop import with_weights_of

    try:
        with_weights_of(build(config, rng=np.random.default_rng(0)), initial)
    except InputError:
        raise InputError(
            f"{path}: weights of networks of other sizes; expected those of a category where one is trained, of a "
            "type or of furniture where that is, by this version"
        ) from None


def file_digest(path: Path | None) -> str | None:
    """The sha256 of a file; None of none."""
    return None if path is None else hashlib.sha256(path.read_bytes()).hexdigest()


def require_positive(minutes: float | None, **counts: int) -> None:
    """Refuse a training of no length.

    Raises:
      InputError: An option, named as it is on the command line, is less than 1, or `minutes` not positive.
    """
    for option, value in counts.items():
        if value < 1:
            raise InputError(f"--{option} is {value}; expected at least 1")
    if minutes is not None and not minutes > 0:
        raise InputError(f"--minutes is {minutes:g}; expected more than 0")
