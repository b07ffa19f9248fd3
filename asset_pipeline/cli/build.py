"""`manipose assets build`: asset folders from the files of a data set, from own meshes, or of the built-in catalogue."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from manipose_mj.console.cluster import cluster
from manipose_mj.console.process import CORES, prepare_workers
from manipose_mj.errors import InputError

CATALOGUE = "catalogue"
LONGEST = 1e6  # that a scan may take [s]: eleven days
Axis = Literal["x", "y", "z", "-x", "-y", "-z"]
Type = Literal["axial", "mirror", "functional"]
_MESHES = "(meshes only)"
_LICENSED = "(meshes and partnet_mobility only)"


def build_assets(
    source: Annotated[Positional[str], arg(metavar="SOURCE")],
    path: Annotated[Positional[Path | None], arg(metavar="PATH")] = None,
    /,
    *,
    out: Annotated[Path | None, arg(metavar="DIR")] = None,
    jobs: int = CORES,
    only: Annotated[tuple[str, ...], arg(metavar="NAME...")] = (),
    beyond: Annotated[int, arg(help_behavior_hint="(catalogue only; default: 0)")] = 0,
    limit_s: float = 300.0,
    dask: Annotated[str | None, arg(metavar="ADDRESS")] = None,
    labels: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None,
    category: Annotated[str | None, arg(metavar="NAME", help_behavior_hint=_MESHES)] = None,
    up: Annotated[Axis | None, arg(help_behavior_hint=_MESHES)] = None,
    unit: Annotated[
        str | None, arg(metavar="m|cm|mm|in|ft|NUMBER", help_behavior_hint=_MESHES)
    ] = None,
    licence: Annotated[str | None, arg(metavar="TEXT", help_behavior_hint=_LICENSED)] = None,
    object_type: Annotated[Type | None, arg(name="type", help_behavior_hint=_MESHES)] = None,
) -> int:
    """Build assets from scans: labels, convex parts, mass, stable poses, grasps, MJCF.

    What is up to date is left alone, so that an interrupted build goes on where it was. Exits with
    2 if an object could not be built; the others are there.

    Args:
      source: Kind of data set, such as ycb; or meshes, files of your own (OBJ, STL, PLY, GLB, DAE); or catalogue,
        the built-in objects, which need no PATH.
      path: The data set's folder or archive, as published; a mesh, or a folder of meshes.
      out: Folder for the assets, one folder each; without it, catalogue fills the cache that
        tasks read.
      jobs: Objects at the same time, one core each.
      only: Objects to build, by name (of the catalogue, also categories); all without it.
      beyond: So many objects of each category that the catalogue does not have, from the same generators: no split
        and no protocol knows them.
      limit_s: Seconds after which the reading and building of a scan is stopped.
      dask: Build on the cluster of this dask scheduler, such as tcp://10.0.0.1:8786; its workers have
        to see PATH and DIR.
      labels: A person's labels (YAML), which override what is measured; without it labels.yaml in
        DIR, where there is one.
      category: What kind of object the meshes are, such as mug; without it by the file's name.
      up: Axis that points up when the object stands; without it guessed.
      unit: Of the mesh's coordinates, also as a number of metres; without it guessed.
      licence: Under which the meshes may be used; without it the assets say that it is unknown. Also of your own
        furniture in the layout of partnet_mobility; without it that data set's.
      object_type: Rule of the label; without it the category's.
    """
    prepare_workers(jobs)
    from asset_pipeline.build.data_set import FURNITURE, OWN, SOURCES, BuildResult, build
    from asset_pipeline.build.workers.limited_call import Limits
    from asset_pipeline.catalogue.parallel_build import build_catalogue
    from asset_pipeline.sources.meshes import MeshOptions
    from manipose_mj.console import output
    from manipose_mj.errors import unknown_name

    own_licence = licence if source == FURNITURE else None
    said = MeshOptions(category, object_type, up, unit, licence if own_licence is None else None)
    if source != OWN and said != MeshOptions():
        raise InputError(
            "--category, --up, --unit, --licence and --type are for meshes, --licence for "
            f"{FURNITURE} too; leave them out, {source} knows its objects"
        )
    if beyond and source != CATALOGUE:
        raise InputError(f"--beyond is for {CATALOGUE}; leave it out, {source} has what PATH holds")
    done: list[BuildResult] = []
    with cluster(dask), output.Progress("assets") as progress:

        def show(result: BuildResult, total: int) -> None:
            done.append(result)
            progress.update(len(done), total, result.name)

        if source == CATALOGUE:
            if path is not None:
                raise InputError(f"the catalogue is built in and reads no files; leave out {path}")
            if labels is not None:
                raise InputError(
                    f"the catalogue's labels are exact by construction; leave out {labels}"
                )
            results = build_catalogue(out, jobs=jobs, only=only, beyond=beyond, progress=show)
        else:
            if source not in SOURCES:
                raise unknown_name("source", source, [CATALOGUE, *SOURCES])
            if path is None or out is None:
                raise InputError(f"{source} needs the PATH of its files and --out DIR")
            if not 0 < limit_s <= LONGEST:
                raise InputError(
                    f"--limit-s is {limit_s:g}; expected seconds, more than 0 and at most {LONGEST:g}"
                )
            limits = Limits(seconds=limit_s)
            results = build(
                source,
                path,
                out,
                jobs=jobs,
                only=only,
                limits=limits,
                labels=labels,
                said=said if source == OWN else None,
                licence=own_licence,
                progress=show,
            )
    failed = [r for r in results if r.status == "failed"]
    for result in failed:
        output.fail_line(f"{result.name}: {result.reason}")
    built = [r for r in results if r.status == "built"]
    console = output.standard_output()
    console.print(
        f"{len(built)} built, {len(results) - len(built) - len(failed)} up to date, "
        f"{len(failed)} failed, in {out or 'the cache'}",
        soft_wrap=True,
    )
    return 2 if failed else 0
