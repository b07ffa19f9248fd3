"""Build the objects of the built-in catalogue ahead of their use, in parallel, resumably."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from asset_pipeline.build.data_set import up_to_date, writable
from asset_pipeline.build.pool import BuildJob, BuildResult, run_jobs
from asset_pipeline.build.replaceable import check_source
from asset_pipeline.catalogue import instance
from manipose_mj.assets import categories as catalogue
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.assets.inventory import BUILT_IN
from manipose_mj.errors import InputError, unknown_name


def build_catalogue(
    out: Path | None = None,
    *,
    jobs: int = 1,
    only: Sequence[str] = (),
    beyond: int = 0,
    progress: Callable[[BuildResult, int], None] | None = None,
) -> list[BuildResult]:
    """Build objects of the catalogue; those that are there, built by the same code, are left alone.

    One generator that fails never stops the rest. Generators are code of ours: their objects are built
    without limits, in the workers themselves.

    Args:
      out: Folder of asset folders; None for the cache, where `catalogue.load` looks.
      jobs: Worker processes.
      only: Names of objects, or of categories for all of theirs; empty for the whole catalogue.
      beyond: Builds so many objects of each category from the same generators instead that the catalogue does not have,
        with the names after its last; 0: its own.
      progress: Called with each result and the number of objects in all.

    Returns:
      One result an object, sorted by name.

    Raises:
      InputError: A name in `only` is unknown, the folder cannot be written, or objects beyond the catalogue have none:
        its cache holds its own.
    """
    if beyond < 0:
        raise InputError(f"beyond is {beyond}; expected a number of objects, at least 0")
    if beyond and out is None:
        raise InputError("objects beyond the catalogue need a folder of their own: --out DIR")
    entries = dict(_beyond(beyond) if beyond else catalogue.entries())
    chosen = _chosen(entries, only)
    if out is not None:
        out = Path(out).absolute()
    with writable(catalogue.cache_folder("mug").parent if out is None else out):
        return run_jobs(
            [
                BuildJob(
                    name=name,
                    folder=catalogue.cached(category, index) if out is None else out / name,
                    where=CATALOGUE[category].module,
                    build=build_instance,
                    arguments=(category, index, catalogue.code_hash(category)),
                    limits=None,
                )
                for name, (category, index) in chosen.items()
            ],
            jobs=jobs,
            progress=progress,
        )


def build_instance(category: str, index: int, code: str, folder: Path, target: Path) -> bool:
    """Build one object into `target`, and return True, unless `folder` is of the same code.

    Raises:
      InputError: `folder` is the asset of another source.
    """
    module = CATALOGUE[category].module
    if up_to_date(folder, {instance.CODE: code}, module):
        return False
    check_source(folder, BUILT_IN)
    instance.build(category, index, target)
    return True


def _beyond(count: int) -> Iterator[tuple[str, tuple[str, int]]]:
    for row in CATALOGUE.values():
        for index in range(row.instances, row.instances + count):
            yield row.instance(index), (row.name, index)


def _chosen(entries: dict[str, tuple[str, int]], only: Sequence[str]) -> dict[str, tuple[str, int]]:
    if not only:
        return entries
    chosen = {}
    for name in only:
        own = {n: e for n, e in entries.items() if name in (n, e[0])}
        if not own:
            known = [*entries, *CATALOGUE]
            raise unknown_name(
                "built-in object or category", name, known, listed_by="manipose list"
            )
        chosen |= own
    return dict(sorted(chosen.items()))
