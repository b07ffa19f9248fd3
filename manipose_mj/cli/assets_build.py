"""`manipose assets build`: asset folders from the files of a data set."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from manipose_mj.cli.process import CORES, one_thread_per_process


def build_assets(
    source: Annotated[Positional[str], arg(metavar="SOURCE")],
    path: Annotated[Positional[Path], arg(metavar="PATH")],
    /,
    *,
    out: Annotated[Path, arg(metavar="DIR")],
    jobs: int = CORES,
    only: Annotated[tuple[str, ...], arg(metavar="NAME...")] = (),
) -> int:
    """Build assets from scans: labels, convex parts, mass, stable poses, grasps, MJCF.

    What is up to date is left alone, so that an interrupted build goes on where it was. Exits with
    2 if an object could not be built; the others are there.

    Args:
      source: Kind of data set, such as ycb.
      path: The data set's folder or archive, as published.
      out: Folder for the assets, one folder each.
      jobs: Objects at the same time, one core each.
      only: Objects to build, by name; all without it.
    """
    one_thread_per_process()
    from asset_pipeline.build import BuildResult, build
    from manipose_mj.cli import output

    done: list[BuildResult] = []
    with output.Progress("assets") as progress:

        def show(result: BuildResult, total: int) -> None:
            done.append(result)
            progress.update(len(done), total, result.name)

        results = build(source, path, out, jobs=jobs, only=only, progress=show)
    failed = [r for r in results if r.status == "failed"]
    for result in failed:
        output.fail_line(f"{result.name}: {result.reason}")
    built = [r for r in results if r.status == "built"]
    console = output.standard_output()
    console.print(
        f"{len(built)} built, {len(results) - len(built) - len(failed)} up to date, "
        f"{len(failed)} failed, in {out}",
        soft_wrap=True,
    )
    return 2 if failed else 0
