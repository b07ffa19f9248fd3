"""`manipose assets relabel`: a person's labels into assets that are built already."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg


def relabel_assets(
    path: Annotated[Positional[Path], arg(metavar="DIR[/NAME]")],
    /,
    *,
    labels: Annotated[Path, arg(metavar="FILE")],
) -> None:
    """Override the labels of built assets with a person's; stable poses and grasps stay.

    An asset without an entry in the file gets back what was measured.

    Args:
      path: An asset's folder, or a folder of assets.
      labels: YAML file of entries by object name; docs/guides/label_corrections.md shows one.
    """
    from asset_pipeline.build.relabel import OVERRIDE, relabel
    from manipose_mj.console import output

    changed = relabel(path, labels)
    console = output.standard_output()
    for asset in changed:
        said = OVERRIDE in asset.provenance.inputs
        done = "relabelled" if said else f"no entry in {labels}; labelled as measured"
        console.print(f"{asset.name}: {done}", soft_wrap=True)
    if not changed:
        console.print(f"{path}: labelled as {labels} says already", soft_wrap=True)
