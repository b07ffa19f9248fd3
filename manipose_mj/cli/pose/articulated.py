"""`manipose pose train-articulated` and `evaluate-articulated`: handles and joints of furniture."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import arg

from manipose_mj.cli.pose.train import (
    CURVE_PICTURE,
    WEIGHTS_FILE,
    check_sizes,
    file_digest,
    require_positive,
    starting_weights,
)
from manipose_mj.console.process import CORES, prepare_workers
from manipose_mj.errors import InputError

log = logging.getLogger(__name__)

_CALIBRATION = 320  # clouds that confidence is fitted on


def train_articulated(
    *,
    out: Annotated[Path, arg(metavar="DIR")] = Path("pose/articulated"),
    scenes: int = 16,
    further: int = 0,
    synthetic: int = 0,
    assets: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="")] = None,
    only: Annotated[tuple[str, ...], arg(metavar="ASSET...", help_behavior_hint="")] = (),
    asset_scenes: int = 48,
    batch: int = 32,
    steps: int = 20_000,
    minutes: Annotated[float | None, arg(help_behavior_hint="")] = None,
    seed: int = 0,
    start_from: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None,
    jobs: int = CORES,
) -> int:
    """Train the estimator of handles and joints on rendered scenes of the catalogue's furniture.

    Goes on where an interrupted training of the same folder was. Writes the weights, the state to go on
    from and the curve, and prints what the weights reach on the catalogue's test furniture.

    Args:
      out: Folder to write to.
      scenes: Of each object; a scene has openings of its own and four views.
      further: Objects of each category beyond the built-in ones, to learn from more of them.
      synthetic: Pieces of synthetic furniture to learn from besides: wardrobes, dressers, desks, large appliances.
      assets: Folder of built furniture, such as PartNet-Mobility's, that is trained on besides.
      only: Of these assets; by default all that have a part with a handle.
      asset_scenes: Of each of them.
      batch: Clouds in a step.
      steps: In all.
      minutes: Ends the training, cooled down, if the steps do not.
      seed: Of the first weights and of all that training draws.
      start_from: Weights of an earlier training to start from, instead of random ones.
      jobs: Processes that render, and beside a GPU make the batches.
    """
    prepare_workers(jobs)
    counts = {"asset-scenes": asset_scenes}
    require_positive(minutes, scenes=scenes, batch=batch, steps=steps, **counts)
    if only and assets is None:
        raise InputError("--only names built furniture; say with --assets where it is")
    for name, count in (("further", further), ("synthetic", synthetic)):
        if count < 0:
            raise InputError(f"--{name} is {count}; expected 0 or more")
    from manipose_mj.tasks.core.config import check_seed

    check_seed(seed, "--seed")
    import jax

    from manipose_mj.console import output
    from manipose_mj.evaluation.protocol.own_assets import built_assets, digest_of
    from manipose_mj.ppf_jax.articulated.model import ArticulatedConfig, ArticulatedModel
    from manipose_mj.ppf_jax.data.articulated.assets import asset_scenes as scenes_of_assets
    from manipose_mj.ppf_jax.data.articulated.cache import (
        SCENES_PER_FILE,
        furniture_names,
        furniture_scenes,
        furniture_stream,
        parallel_furniture_stream,
    )
    from manipose_mj.ppf_jax.data.articulated.subject import CATEGORIES
    from manipose_mj.ppf_jax.evaluation.part_evaluation import calibrated, scene_clouds
    from manipose_mj.ppf_jax.training.articulated_losses import ArticulatedLoss
    from manipose_mj.ppf_jax.training.curve_picture import draw_curve
    from manipose_mj.ppf_jax.training.loop import (
        CURVE_FILE,
        Row,
        TrainingConfig,
        train,
    )
    from manipose_mj.ppf_jax.training.saved_state import check_resumable
    from manipose_mj.ppf_jax.weight_files import TrainedModel, save_weights

    initial = starting_weights(start_from, "articulated")
    if initial is not None:
        check_sizes(start_from, initial, ArticulatedConfig(), ArticulatedModel)
    training = TrainingConfig(steps=steps, seed=seed, loss=ArticulatedLoss())  # pyright: ignore[reportArgumentType]
    about = {
        "--scenes": scenes,
        "--further": further,
        "--synthetic": synthetic,
        "--assets": None if assets is None else digest_of(built_assets([assets])),
        "--only": sorted(only),
        "--asset-scenes": asset_scenes,
        "--batch": batch,
        "--start-from": file_digest(start_from),
    }
    check_resumable(out, training, about, ArticulatedConfig())
    objects = furniture_names("train", further, synthetic)
    with output.Progress("objects rendered") as progress:
        known = furniture_scenes(
            objects,
            "training",
            scenes=scenes,
            jobs=jobs,
            progress=progress.update,
        )
    # Confidence is about clouds as they come, not as training keeps them.
    few = objects[:: max(1, len(objects) * SCENES_PER_FILE // _CALIBRATION)]
    calibration = furniture_scenes(few, "front", scenes=SCENES_PER_FILE, jobs=jobs)
    built = []
    if assets is not None:
        wanted = only or None
        built = scenes_of_assets(assets, "training", scenes=asset_scenes, jobs=jobs, only=wanted)
        calibration += scenes_of_assets(
            assets, "front", scenes=SCENES_PER_FILE, jobs=jobs, only=wanted
        )
    feed = furniture_stream([*known, *built], batch, seed)
    if jobs > 1 and jax.default_backend() != "cpu":
        feed = parallel_furniture_stream(
            objects, "training", scenes=scenes, batch=batch, seed=seed, jobs=jobs, others=built
        )
    with output.Progress("steps") as progress:

        def show(row: Row) -> None:
            progress.update(int(row["step"]) + 1, steps, f"loss {row['loss']:.3f}")

        model = train(
            feed,  # pyright: ignore[reportArgumentType]
            ArticulatedConfig(),
            training,
            out,
            build=ArticulatedModel,
            initial=initial,
            about=about,
            minutes=minutes,
            progress=show,
        )
    model = calibrated(model, scene_clouds(calibration))
    save_weights(out / WEIGHTS_FILE, TrainedModel(model, CATEGORIES))  # pyright: ignore[reportArgumentType]
    draw_curve(out / CURVE_FILE, out / CURVE_PICTURE)
    output.standard_output().print(
        f"trained on {len(known) + len(built)} scenes; {out / WEIGHTS_FILE}", soft_wrap=True
    )
    return evaluate_articulated(weights=out / WEIGHTS_FILE, jobs=jobs)


def evaluate_articulated(
    *,
    weights: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None,
    split: Literal["train", "test"] = "test",
    scenes: int = 8,
    jobs: int = CORES,
    json: bool = False,
) -> int:
    """Evaluate the estimator of handles and joints on rendered scenes of the catalogue's furniture.

    Shares of the parts whose handle a cloud shows: handle's centre within 1.5 cm, its axes and the joint's
    direction within 5 degrees, a hinge's axis within 2 cm, the joint's type right.

    Args:
      weights: File that manipose pose train-articulated wrote; those of the package without it.
      split: Of the catalogue.
      scenes: Of each object; one view of each, and all three from the front together.
      jobs: Processes that render.
      json: Print JSON, for other programs.
    """
    prepare_workers(jobs)
    if scenes < 1:
        raise InputError(f"--scenes is {scenes}; expected at least 1")
    from rich.table import Table

    from manipose_mj.console import output
    from manipose_mj.ppf_jax.articulated_estimator import ArticulatedEstimator
    from manipose_mj.ppf_jax.data.articulated.cache import furniture_names, furniture_scenes
    from manipose_mj.ppf_jax.evaluation.part_evaluation import evaluated, scene_clouds
    from manipose_mj.ppf_jax.evaluation.part_metrics import summary

    if weights is None:
        estimator = ArticulatedEstimator.load()
    else:
        estimator = ArticulatedEstimator.from_file(weights)
    with output.Progress(f"{split} objects rendered") as progress:
        shown = furniture_scenes(
            furniture_names(split), "front", scenes=scenes, jobs=jobs, progress=progress.update
        )
    rows = []
    for fused in (1, 3):
        found = evaluated(estimator, scene_clouds(shown, fused=fused))
        figures = summary(found.errors, found.false_positives, found.clouds)
        rows.append({"views": fused, "category": "all"} | figures)
        for category in dict.fromkeys(scene.category for scene in shown):
            own = [e for e in found.errors if e.name.startswith(category)]
            if not own:
                log.warning("%s: no handle shows (views: %d), left out", category, fused)
                continue
            figures = summary(own, 0, found.clouds)
            del figures["false_positives_per_cloud"]  # nobody knows of which category they are
            rows.append({"views": fused, "category": category} | figures)
    if json:
        output.write_json(rows)
        return 0
    table = Table("views", "category", title=f"{split} furniture, parts whose handle shows")
    shares = {
        "found": "found",
        "centre": "centre_within",
        "axes": "axes_within",
        "type": "type_right",
        "way": "direction_within",
        "line": "line_within",
        "handle": "handle_right",
        "joint": "joint_right",
        "all": "all_right",
        "objects": "objects_right",
    }
    medians = {
        "cm": "centre_cm_median",
        "deg": "axes_deg_median",
        "line cm": "line_cm_median",
        "open deg": "opening_deg_median",
        "open cm": "opening_cm_median",
    }
    for head in ("n", *shares, *medians):
        table.add_column(head, justify="right")
    for row in rows:
        table.add_row(
            str(row["views"]),
            str(row["category"]),
            str(row["n"]),
            *(output.figure(row[name], ".0%") for name in shares.values()),
            *(output.figure(row[name], ".2f") for name in medians.values()),
        )
    output.standard_output().print(table)
    return 0
