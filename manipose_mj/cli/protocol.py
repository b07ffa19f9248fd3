"""`manipose protocol`: certificates that a protocol's starts can be solved, and the assets that one asks for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from manipose_mj.console.command_line import CommandApp
from manipose_mj.console.process import (
    CORES,
    keep_to_avx2,
    prepare_workers,
)
from manipose_mj.errors import InputError

if TYPE_CHECKING:
    from manipose_mj.evaluation.certification.certificates import Key

_EXIT_FAILED = 1


def build_app() -> CommandApp:
    """The commands under `manipose protocol`."""
    app = CommandApp()
    app.add("verify", verify_protocol)
    app.add("certify", certify_protocol)
    app.add("assets", protocol_assets)
    return app


def verify_protocol(
    version: Annotated[Positional[str], arg(metavar="VERSION", help_behavior_hint="")] = "v1",
    /,
    *,
    tasks: Annotated[tuple[str, ...], arg(metavar="TASK...", help_behavior_hint="")] = (),
    episodes: Annotated[int | None, arg(metavar="INT", help_behavior_hint="")] = None,
    jobs: int = CORES,
    certificates: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None,
    assets: Annotated[tuple[str, ...], arg(metavar="DIR...", help_behavior_hint="")] = (),
) -> int:
    """Replay the certificates of a protocol's starts: the baseline must solve each again.

    Where one does not hold, as may be on another kind of processor, the start is tried by other samples of the planner,
    twice as many as by certify. Such starts are named as they are found, on standard error, and at the end. Exits with
    1 if none solves one, or if a certificate has lapsed: the protocol then has another start in its place.

    Args:
      version: Of the protocol.
      tasks: Only these, or those that fit patterns such as "clutter/*"; by default all.
      episodes: Only the first so many of each task; by default all.
      jobs: Episodes at the same time, one core each.
      certificates: File of certificates; by default the package's own.
      assets: Folders of assets built from the data sets of v1-real.
    """
    prepare_workers(jobs)
    keep_to_avx2()
    from manipose_mj.console import output
    from manipose_mj.evaluation.certification.certificates import load_certificates
    from manipose_mj.evaluation.certification.search import chosen_starts, verify
    from manipose_mj.evaluation.protocol.frozen import load
    from manipose_mj.evaluation.protocol.own_assets import find_assets

    protocol = load(version)
    if certificates is not None and not certificates.is_file():
        raise InputError(f"{certificates}: no such file of certificates")
    known = load_certificates(protocol, certificates)
    starts = chosen_starts(protocol, tasks, episodes)
    find_assets(version, {task for task, _ in starts}, assets)
    certified = [start for start in starts if start in known.solved]
    lapsed = [start for start in starts if start in known.lapsed]
    failed: dict[Key, str] = {}
    unsolved = 0
    with output.Progress("certificates") as progress:
        for done, (start, outcome) in enumerate(verify(version, known, certified, jobs, assets), 1):
            if isinstance(outcome, str):
                failed[start] = outcome
                unsolved += 1
            elif outcome != known.solved[start]:
                failed[start] = (
                    f"its certificate does not hold here; solved by planner seed {outcome.planner_seed} "
                    f"and {outcome.plans} plans"
                )
            if start in failed:
                progress.say(f"{start[0]} {start[1]}: {failed[start]}")
            progress.update(done, len(certified), f"{done - len(failed)} hold")
    console = output.standard_output()
    tried = {*known.solved, *known.unsolved, *lapsed}
    changed = dict.fromkeys(
        lapsed, "its certificate has lapsed: its start is another than was certified"
    )
    for (task, number), said in sorted({**failed, **changed}.items()):
        console.print(f"{task} {number}: {said}", soft_wrap=True)
    console.print(
        f"{len(certified) - len(failed)} of {len(certified)} certificates hold, {len(failed) - unsolved} starts "
        f"are solved by other samples, {unsolved} by none; of {len(starts)} starts, "
        + (f"the certificates of {len(lapsed)} have lapsed, " if lapsed else "")
        + f"{sum(start in known.unsolved for start in starts)} are known as unsolved and "
        f"{sum(start not in tried for start in starts)} untried",
        soft_wrap=True,
    )
    return _EXIT_FAILED if unsolved or lapsed else 0


def certify_protocol(
    version: Annotated[Positional[str], arg(metavar="VERSION", help_behavior_hint="")] = "v1",
    /,
    *,
    out: Annotated[Path, arg(metavar="FILE", help_behavior_hint="")],
    tasks: Annotated[tuple[str, ...], arg(metavar="TASK...", help_behavior_hint="")] = (),
    episodes: Annotated[int | None, arg(metavar="INT", help_behavior_hint="")] = None,
    again: Annotated[bool, arg(help_behavior_hint="")] = False,
    jobs: int = CORES,
    assets: Annotated[tuple[str, ...], arg(metavar="DIR...", help_behavior_hint="")] = (),
) -> int:
    """Find the certificates that are missing: a planner's seed and a number of plans that solve a start.

    The file is written anew after every start; an interrupted search goes on from it.

    Args:
      version: Of the protocol.
      out: File of certificates, new or to be completed.
      tasks: Only these, or those that fit patterns such as "clutter/*"; by default all.
      episodes: Only the first so many of each task; by default all.
      again: Try starts that were not solved once more.
      jobs: Episodes at the same time, one core each.
      assets: Folders of assets built from the data sets of v1-real.
    """
    prepare_workers(jobs)
    keep_to_avx2()
    from manipose_mj.console import output
    from manipose_mj.evaluation.certification.certificates import (
        causes,
        load_certificates,
        save_certificates,
    )
    from manipose_mj.evaluation.certification.search import certify, chosen_starts
    from manipose_mj.evaluation.protocol.frozen import load
    from manipose_mj.evaluation.protocol.own_assets import find_assets

    if not out.parent.is_dir():
        raise InputError(f"{out.parent}: no such folder")
    protocol = load(version)
    known = load_certificates(protocol, out)
    starts = chosen_starts(protocol, tasks, episodes)
    find_assets(version, {task for task, _ in starts}, assets)
    settled = set(known.solved) if again else {*known.solved, *known.unsolved}
    missing = [each for each in starts if each not in settled]
    with output.Progress("starts") as progress:
        for done, (start, outcome) in enumerate(certify(version, missing, jobs, assets), 1):
            known = known.with_outcome(start, outcome)
            save_certificates(known, protocol, out)
            progress.update(done, len(missing), f"{len(known.solved)} certified")
    console = output.standard_output()
    for (task, number), reason in sorted(known.unsolved.items()):
        console.print(f"{task} {number}: {reason}", soft_wrap=True)
    for (task, stage), count in sorted(causes(known).items()):
        console.print(f"{task}: {count} starts unsolved, stage {stage}", soft_wrap=True)
    console.print(f"{out}: {len(known.solved)} certified, {len(known.unsolved)} unsolved")
    return 0


def protocol_assets(
    version: Annotated[Positional[str], arg(metavar="VERSION", help_behavior_hint="")] = "v1-real",
    /,
    *,
    tasks: Annotated[tuple[str, ...], arg(metavar="TASK...", help_behavior_hint="")] = (),
    assets: Annotated[tuple[str, ...], arg(metavar="DIR...", help_behavior_hint="")] = (),
) -> int:
    """List the objects of data sets that a protocol leaves to you to build; exits with 1 if folders lack some.

    Args:
      version: Of the protocol.
      tasks: For these only; by default for all.
      assets: Folders of built assets to look into.
    """
    from manipose_mj.console import output
    from manipose_mj.evaluation.protocol.frozen import load
    from manipose_mj.evaluation.protocol.own_assets import built_assets, needed

    protocol = load(version)
    names = needed(protocol, tasks or protocol.tasks)
    present = {(asset.data_set, asset.name) for asset in built_assets(assets)}
    console, lacking = output.standard_output(), 0
    for data_set in dict.fromkeys(protocol.sources[name] for name in names):
        own = [name for name in names if protocol.sources[name] == data_set]
        missing = [name for name in own if (data_set, name) not in present]
        lacking += len(missing)
        console.print(f"{data_set}, {len(own)} objects: {' '.join(own)}", soft_wrap=True)
        if assets:
            said = f"lacks {' '.join(missing)}" if missing else "has them all"
            console.print(f"  {' '.join(assets)} {said}", soft_wrap=True)
    if not names:
        console.print(f"protocol {version}: all objects are built in")
    return _EXIT_FAILED if assets and lacking else 0
