"""`manipose evaluate`: episodes of the baseline or of a policy, their statistics and the report."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import OmitArgPrefixes, Positional, arg

from manipose_mj.console.cluster import cluster
from manipose_mj.console.process import CORES, prepare_workers
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.evaluation.injected_errors import InjectedErrors

if TYPE_CHECKING:
    from manipose_mj.evaluation.records import EpisodeResult

BASELINE = "baseline"
NO_ERRORS = InjectedErrors()


def evaluate(
    tasks: Annotated[Positional[tuple[str, ...]], arg(metavar="TASK...", help_behavior_hint="")],
    /,
    *,
    episodes: Annotated[int | None, arg(metavar="INT", help_behavior_hint="")] = None,
    seed: int = 0,
    pose: Literal["oracle", "estimated", "estimated_objects"] = "oracle",
    jobs: int = CORES,
    out: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="")] = None,
    resume: Annotated[bool, arg(help_behavior_hint="")] = False,
    objects: Annotated[
        tuple[str, ...], arg(aliases=("--object",), metavar="NAME|DIR...", help_behavior_hint="")
    ] = (),
    protocol: Annotated[str | None, arg(metavar="v1|v1-real", help_behavior_hint="")] = None,
    assets: Annotated[tuple[str, ...], arg(metavar="DIR...", help_behavior_hint="")] = (),
    resample: Annotated[int | None, arg(metavar="SEED", help_behavior_hint="")] = None,
    dask: Annotated[str | None, arg(metavar="ADDRESS", help_behavior_hint="")] = None,
    policy: Annotated[
        str, arg(metavar="baseline|MODULE:FACTORY|ws://HOST:PORT", help_behavior_hint="")
    ] = BASELINE,
    policy_args: Annotated[str | None, arg(metavar="JSON", help_behavior_hint="")] = None,
    obs_mode: Annotated[str | None, arg(metavar="MODES", help_behavior_hint="")] = None,
    control_mode: Annotated[str | None, arg(metavar="MODE", help_behavior_hint="")] = None,
    hz: Annotated[float | None, arg(metavar="HZ", help_behavior_hint="")] = None,
    execute: Annotated[int | None, arg(metavar="N", help_behavior_hint="")] = None,
    obs_format: Annotated[Literal["manipose", "droid"] | None, arg(help_behavior_hint="")] = None,
    stop: Annotated[Literal["success", "horizon"] | None, arg(help_behavior_hint="")] = None,
    planner: Literal["rules", "llm", "replay"] = "rules",
    model: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="")] = None,
    base_url: Annotated[str | None, arg(metavar="URL", help_behavior_hint="")] = None,
    replay: Annotated[Path | None, arg(metavar="FILE|DIR", help_behavior_hint="")] = None,
    instruction: Annotated[str | None, arg(metavar="TEXT", help_behavior_hint="")] = None,
    estimator: Annotated[
        str | None, arg(metavar="MODULE:FACTORY|ws://HOST:PORT", help_behavior_hint="")
    ] = None,
    estimator_args: Annotated[str | None, arg(metavar="JSON", help_behavior_hint="")] = None,
    give_cad: Annotated[bool, arg(help_behavior_hint="")] = False,
    engine: Annotated[Literal["c", "warp"] | None, arg(help_behavior_hint="")] = None,
    worlds: Annotated[int | None, arg(metavar="N", help_behavior_hint="")] = None,
    grasps: Annotated[
        Literal["annotated", "shape", "cloud"] | None, arg(help_behavior_hint="")
    ] = None,
    errors: Annotated[InjectedErrors, OmitArgPrefixes] = NO_ERRORS,
) -> int:
    """Run a policy, and write results.jsonl, summary.json and report.html.

    Args:
      tasks: Tasks to run, as `manipose list` names them, or patterns of names in quotes, such as "clutter/*".
      episodes: Episodes per task; by default 50, or all of a protocol.
      seed: Base seed; each episode derives its own from it.
      pose: Where the baseline takes its knowledge from: the simulator, or clouds; or clouds of objects only,
        furniture and surroundings from the simulator.
      jobs: Episodes at the same time, one core each; results do not depend on it.
      out: Folder for the results; by default a new one under manipose_results.
      resume: Go on with the results in --out, after an interruption or with more tasks or episodes.
      objects: What to draw from instead of all built-in objects for training: names of built-in ones, asset
        folders, or folders of asset folders.
      protocol: Frozen protocol to follow: its evaluation seeds, and its test objects; those of v1-real are scans
        that you build.
      assets: Folders with what `manipose assets build` made of the data sets of v1-real.
      resample: Play a protocol's episodes with other seeds, drawn from this one; their objects of question stay.
      dask: Run on the cluster of this dask scheduler, such as tcp://10.0.0.1:8786, instead of --jobs; its
        workers have to see --out and the folders of --objects.
      policy: Whose episodes: the baseline's; those of what a factory of a Python module makes; or those of a
        server that speaks openpi's websocket protocol. The options below are for the latter two.
      policy_args: Keyword arguments of the factory, as a JSON object.
      obs_mode: What the policy sees, joined by +: state, pose, rgb, depth, segmentation, pointcloud, or keys of them;
        by default state, and state+rgb in DROID's format.
      control_mode: What its actions mean; by default pd_joint_pos.
      hz: Its actions per second of simulated time, by default 10, at most 50; targets are held in between.
      execute: How many actions of each answer are carried out; by default all, as of an answer that says done.
      obs_format: Names of its observations: manipose by default, or DROID's.
      stop: When an episode ends: once the goal has held for 0.5 s, as by default, or at the time limit.
      planner: Makes the baseline's plans: rules, a language model, or the recorded answers of one.
      model: Name of the language model.
      base_url: Of its OpenAI-compatible endpoint, such as http://localhost:8000/v1; the key comes from
        OPENAI_API_KEY.
      replay: Exchanges that an evaluation by a language model has left in DIR/exchanges.
      instruction: What the language model shall do instead of what the episode asks for.
      estimator: Whose estimates --pose estimated means: those of what a factory of a Python module makes, or of a
        server; by default those of the package's weights.
      estimator_args: Keyword arguments of its factory, as a JSON object.
      give_cad: Give it the mesh of the very object that is seen; the results say so.
      engine: Play a policy that has a method act in batched worlds: c on the CPU, warp on a GPU.
      worlds: Of these, by default 256.
      grasps: Where the baseline's grasps come from: the object's own, the shape that was fitted to its cloud, or the
        cloud; by default annotated with true poses and cloud with estimated ones.
      errors: Made on purpose, to measure what they cost.
    """
    prepare_workers(jobs)
    from manipose_mj.cli.builtin_objects import load_objects, names_in_protocol
    from manipose_mj.estimators.loading import load_estimator
    from manipose_mj.estimators.settings import chosen_estimator
    from manipose_mj.evaluation.config import BatchSettings, EvaluationConfig
    from manipose_mj.evaluation.planner_settings import EXCHANGES, PlannerSettings
    from manipose_mj.evaluation.policy_settings import PolicySettings
    from manipose_mj.evaluation.protocol.frozen import EPISODES
    from manipose_mj.evaluation.results_folder import check_folder
    from manipose_mj.mjcf.panda.robot import picture_visuals
    from manipose_mj.tasks import registered  # noqa: F401  (registers the tasks)
    from manipose_mj.tasks.core.registry import tasks_named

    tasks = tasks_named(tasks)
    check_names(tasks, objects)
    if out is None:
        if resume:
            raise InputError("--resume needs --out: the folder whose evaluation goes on")
        out = Path("manipose_results") / time.strftime("%Y%m%d-%H%M%S")
    if episodes is None:
        episodes = EPISODES.get(protocol, 50) if protocol else 50
    options = {
        "arguments": policy_args,
        "obs_mode": obs_mode,
        "control_mode": control_mode,
        "hz": hz,
        "execute": execute,
        "obs_format": obs_format,
        "stop": stop,
    }
    given = {name: value for name, value in options.items() if value is not None}
    if policy == BASELINE and given:
        names = ", ".join(name.replace("_", " ") for name in given)
        raise InputError(f"{names}: for a policy only; name one by --policy, or leave them out")
    if worlds is not None and engine is None:
        raise InputError("--worlds needs --engine: c or warp")
    batch = None if engine is None else BatchSettings(engine, 256 if worlds is None else worlds)
    settings = None if policy == BASELINE else PolicySettings(policy, **given)
    record = out / EXCHANGES if planner == "llm" else None
    planning = PlannerSettings(planner, model, base_url, replay, instruction, record)
    config = EvaluationConfig(
        tasks,
        out,
        episodes,
        seed,
        pose,
        jobs,
        objects or None,
        protocol=protocol,
        dask=dask,
        policy=settings,
        resample=resample,
        planner=planning,
        estimator=chosen_estimator(estimator, estimator_args, give_cad),
        batch=batch,
        errors=errors,
        grasps=grasps,
        assets=assets,
    )
    named = check_names(tasks, objects)
    # Before minutes are spent on building objects, and hours on episodes that the report shall show.
    check_folder(out, resume=resume)
    picture_visuals()
    if config.estimator is not None:
        load_estimator(config.estimator)
    if protocol is not None:
        named = names_in_protocol(protocol, tasks, episodes)
    with cluster(dask):
        # Once, before the episodes: their workers would each build the same. What seeds draw is built when it is
        # drawn.
        load_objects(named, jobs)
    return run_and_report(config, resume=resume)


def run_and_report(config, *, resume: bool) -> int:
    """Evaluate with progress, write the report and print the table.

    Args:
      config: An `EvaluationConfig`.
      resume: Keep the results that its folder holds.
    """
    from manipose_mj.console import output
    from manipose_mj.evaluation.report.html import write_report
    from manipose_mj.evaluation.runner import evaluate as run
    from manipose_mj.evaluation.statistics import summarize

    with output.Progress("episodes") as progress:

        def show(done, total) -> None:
            progress.update(len(done), total, f"{sum(r.success_at_end for r in done)} succeeded")

        began = os.getcwd()
        results = run(config, resume=resume, on_progress=show)
        os.chdir(began)  # a policy may have changed it
    with output.working_on("drawing the report"):
        report = write_report(config.out, jobs=config.jobs)
    console = output.standard_output()
    console.print(output.summary_table(summarize(results)))
    for line in common_reasons(results, config.out):
        console.print(line, soft_wrap=True)
    console.print(f"report: {report}", soft_wrap=True)
    # Where nothing could be played, nothing was found out.
    return int(bool(results) and all(result.failure == "error" for result in results))


def common_reasons(results: Sequence[EpisodeResult], out: Path) -> list[str]:
    """A line for each of the three commonest reasons why episodes failed, the policy's own first, with its traceback."""
    from manipose_mj.evaluation.records import trajectory_path

    failed: dict[tuple[str, str], list[EpisodeResult]] = {}
    for result in results:
        if result.failure is not None and result.reason:
            failed.setdefault((result.failure, result.reason), []).append(result)
    ranked = sorted(failed.items(), key=lambda each: (each[0][0] != "policy", -len(each[1])))
    lines = []
    for (stage, reason), those in ranked[:3]:
        path = trajectory_path(out, those[0].task, those[0].episode).with_suffix(".error.txt")
        see = f"; see {path}" if path.exists() else ""
        what = "the policy" if stage == "policy" else stage
        lines.append(f"failed in {what}, {len(those)} of {len(results)}: {reason}{see}")
    return lines


def check_names(tasks: tuple[str, ...], objects: tuple[str, ...]) -> list[str]:
    """Find misspelt names before anything is written.

    Returns:
      Those of the objects that are built in.

    Raises:
      InputError: There is no task, built-in object or asset folder of a name.
    """
    from manipose_mj.assets import categories
    from manipose_mj.suite import ALL_TASKS
    from manipose_mj.tasks.core.object_selection import asset_folders, is_folder

    known = ["/".join(task) for task in ALL_TASKS]
    for name in objects:
        if name in known:
            raise InputError(f"--objects names {name}, a task; write tasks before options")
    for task in tasks:
        if task not in known:
            raise unknown_name("task", task, known)
    built_in = [each for each in objects if not is_folder(each)]
    for name in built_in:
        categories.find(name)
    for each in objects:
        if each not in built_in:
            asset_folders(Path(each))
    return built_in
