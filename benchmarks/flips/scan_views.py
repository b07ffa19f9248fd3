"""Rendered views of raw scans with their labels, without building assets: what `flip_table.py` reads.

    python benchmarks/flips/scan_views.py google_scanned_objects PATH --out VIEWS/gso [--views 12] [--kinds benchmarks/flips/kinds.yaml]
        [--skip-every 3]
    python benchmarks/flips/scan_views.py catalogue --out VIEWS/catalogue [--views 12]

A build takes most of its time for convex parts and grasps, which nobody needs to measure an estimator. `--kinds` is
a file of label overrides, of which category and type are used: product names say neither. `--skip-every 3` leaves out
every third scan by name, which is kept for validation; `--only-every 3` renders these and no others. `catalogue` is
three training objects of every category.
"""

from __future__ import annotations

import argparse
import json
import logging
import sys
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from asset_pipeline.labelling.overrides.reading import Override, read_overrides
from asset_pipeline.labelling.scan_label import scan_label
from asset_pipeline.sources import google_scanned_objects, ycb
from asset_pipeline.sources.scan import ScanItem
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.ppf_jax.data.rendering import Subject, render_clouds
from manipose_mj.ppf_jax.data.view_cache import catalogue_subject
from manipose_mj.ppf_jax.data.view_settings import ViewSetting, view_setting
from manipose_mj.ppf_jax.points.cloud_files import INDEX, ScanViews, write_clouds

log = logging.getLogger("scan_views")
SOURCES = {"google_scanned_objects": google_scanned_objects, "ycb": ycb}
OWN, OBJECTS = "catalogue", 3  # of each category
Split = tuple[int, int]  # leave out every so manyth; only every so manyth; 0 for neither


def render_scan(
    source: str, item: ScanItem, said: Override | None, setting: ViewSetting, views: int
) -> ScanViews:
    """Label one scan and render it; the same whenever it is done.

    Raises:
      InputError: The scan cannot be read, labelled or seen.
    """
    with SOURCES[source].opened(item) as scan:
        category = (said and said.category) or scan.category
        kind = (said and said.object_type) or scan.object_type
        label, _ = scan_label(
            scan.mesh, kind, scan.up, category=category, textured=False, functional=scan.functional
        )
        subject = Subject.of_mesh(scan.mesh, label, name=scan.name, category=category)
    rng = np.random.default_rng(zlib.crc32(scan.name.encode()))
    clouds = render_clouds(subject, setting, views, rng)
    return ScanViews(scan.name, category, kind, tuple(clouds))


def render_catalogue(setting: ViewSetting, views: int) -> Iterator[ScanViews]:
    """`OBJECTS` training objects of every rigid category, spread over its instances."""
    for row in CATALOGUE.values():
        if row.object_type == "articulated":
            continue
        training = [i for i in range(row.instances) if row.split(i) == "train"][1:]
        for index in training[:: max(1, len(training) // OBJECTS)][:OBJECTS]:
            name = row.instance(index)
            subject = catalogue_subject(row.name, index, resting=False)
            rng = np.random.default_rng(zlib.crc32(name.encode()))
            clouds = render_clouds(subject, setting, views, rng)
            yield ScanViews(name, row.name, row.object_type, tuple(clouds))


def render_source(
    source: str, path: Path, kinds: Path | None, setting: ViewSetting, views: int, split: Split
) -> Iterator[ScanViews]:
    """Every scan of a data set that can be read, in a split of `chosen`.

    Raises:
      InputError: The data set or the file of kinds cannot be read.
    """
    said = {} if kinds is None else read_overrides(kinds)
    for item in chosen(SOURCES[source].items(path), *split):
        try:
            yield render_scan(source, item, said.get(item.name), setting, views)
        except InputError as error:
            log.warning("%s: left out, %s", item.name, error)


def chosen(items: Sequence[ScanItem], skip: int, only: int) -> list[ScanItem]:
    """The items that a split leaves: all but every `skip`-th by name, or every `only`-th; 0 for no split."""
    ordered = sorted(items, key=lambda item: item.name)
    numbered = list(enumerate(ordered, 1))
    if only:
        return [item for number, item in numbered if number % only == 0]
    return [item for number, item in numbered if not skip or number % skip]


def main(argv: Sequence[str] | None = None) -> int:
    """Render; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("source", metavar="SOURCE", help=f"one of {', '.join([*SOURCES, OWN])}")
    parser.add_argument("path", nargs="?", type=Path, metavar="PATH", help="the data set")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--views", type=int, default=12, help="of each scan")
    parser.add_argument("--setting", default="anywhere")
    parser.add_argument("--kinds", type=Path, metavar="FILE", help="categories and types, YAML")
    parser.add_argument("--skip-every", type=int, default=0, metavar="N")
    parser.add_argument("--only-every", type=int, default=0, metavar="N")
    options = parser.parse_args(argv)
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    try:
        setting = view_setting(options.setting)
        if options.source == OWN:
            scans = render_catalogue(setting, options.views)
        elif options.source in SOURCES and options.path is not None:
            split = options.skip_every, options.only_every
            scans = render_source(
                options.source, options.path, options.kinds, setting, options.views, split
            )
        elif options.source in SOURCES:
            raise InputError(f"{options.source} needs a PATH")
        else:
            raise unknown_name("source", options.source, [*SOURCES, OWN])
        options.out.mkdir(parents=True, exist_ok=True)
        index: dict[str, tuple[str, str]] = {}
        for scan in scans:
            write_clouds(options.out / f"{scan.name}.npz", scan.clouds)
            index[scan.name] = (scan.category, scan.object_type)
            (options.out / INDEX).write_text(json.dumps(index, indent=1) + "\n")
    except InputError as error:
        print(f"scan_views: {error}", file=sys.stderr)
        return 2
    print(f"{len(index)} scans in {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
