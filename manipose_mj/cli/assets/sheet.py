"""`manipose assets sheet`: one picture a category, all its objects with their labels."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from manipose_mj.console.process import CORES, prepare_workers
from manipose_mj.errors import InputError, unknown_name

if TYPE_CHECKING:
    from manipose_mj.assets.asset import Asset
    from manipose_mj.mjcf.views.contact_sheet import Cell


def draw_sheets(
    directory: Annotated[
        Positional[Path | None], arg(metavar="[DIR]", help_behavior_hint="")
    ] = None,
    /,
    *,
    out: Annotated[Path, arg(metavar="FOLDER")],
    category: Annotated[tuple[str, ...], arg(metavar="NAME...")] = (),
    size: int = 200,
    jobs: int = CORES,
) -> None:
    """Draw contact sheets: every object of a category with its label's axes, X red, Y green, Z blue.

    All are seen from the same side of their label, so that a wrong one stands out. Joint axes are
    cyan; handles have axes too. Built-in objects are drawn without being built.

    Args:
      directory: Folder of assets; without it the built-in objects.
      out: Folder for the pictures, CATEGORY.png.
      category: Only these; all without it.
      size: Of one object's picture, in pixels.
      jobs: Objects at the same time, one core each.
    """
    if size < 32:
        raise InputError(f"--size is {size}; expected at least 32 pixels")
    prepare_workers(jobs)
    import joblib

    from manipose_mj.console import output
    from manipose_mj.mjcf.views.contact_sheet import contact_sheet

    sheets = _built_in(category) if directory is None else _in_folder(directory, category)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"{out}: cannot write there ({reason}); choose another --out") from None
    total, done = sum(map(len, sheets.values())), 0
    if directory is None:
        hint = "" if category else "; --category NAME draws fewer, DIR the assets of a folder"
        output.standard_output().print(
            f"no folder given: drawing {total} built-in objects of {len(sheets)} categories{hint}",
            soft_wrap=True,
        )
    pool = joblib.Parallel(n_jobs=jobs, return_as="generator")
    cells: Iterator[Cell] = pool(
        joblib.delayed(_cell)(entry, size) for entries in sheets.values() for entry in entries
    )  # pyright: ignore[reportAssignmentType]
    try:
        with output.Progress("objects") as progress:
            for name, entries in sheets.items():
                own = []
                for _ in entries:
                    own.append(next(cells))
                    done += 1
                    progress.update(done, total, own[-1].name)
                contact_sheet(f"{name}: {len(own)}", own).save(out / f"{name}.png")
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror or error})") from None
    output.standard_output().print(f"{len(sheets)} sheets in {out}", soft_wrap=True)


def _built_in(categories: tuple[str, ...]) -> dict[str, list[Any]]:
    from manipose_mj.assets.categories import CATALOGUE

    for name in categories:
        if name not in CATALOGUE:
            raise unknown_name("category", name, CATALOGUE)
    return {
        name: [(name, index) for index in range(row.instances)]
        for name, row in CATALOGUE.items()
        if not categories or name in categories
    }


def _in_folder(directory: Path, categories: tuple[str, ...]) -> dict[str, list[Any]]:
    from manipose_mj.assets.asset_json import list_assets, read_asset

    sheets: dict[str, list[Any]] = {}
    for folder in list_assets(directory):
        sheets.setdefault(read_asset(folder).category, []).append(folder)
    for name in categories:
        if name not in sheets:
            raise unknown_name("category", name, sheets)
    return {name: sheets[name] for name in sorted(sheets) if not categories or name in categories}


def _cell(entry: Path | tuple[str, int], size: int) -> Cell:
    """Of an asset folder, or of a built-in object by category and index."""
    from manipose_mj.assets.asset_json import read_asset
    from manipose_mj.assets.catalogue import draft
    from manipose_mj.assets.model_file import check_model

    if isinstance(entry, Path):
        asset = read_asset(entry)
        check_model(asset)
        return _drawn(asset, size)
    with tempfile.TemporaryDirectory(prefix="manipose-sheet-") as folder:
        return _drawn(draft(*entry, Path(folder)), size)


def _drawn(asset: Asset, size: int) -> Cell:
    from manipose_mj.assets.symmetry_names import symmetry_name
    from manipose_mj.mjcf.views.contact_sheet import Cell
    from manipose_mj.mjcf.views.thumbnails import thumbnail

    label = asset.label
    lengths = " x ".join(f"{1000 * v:.0f}" for v in label.extents)
    note = f"{symmetry_name(label.symmetry)}; {lengths} mm"
    return Cell(thumbnail(asset, size), asset.name, note)
