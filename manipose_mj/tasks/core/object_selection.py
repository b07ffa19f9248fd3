"""Objects as users name them: built-in ones, asset folders, or folders of asset folders."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import ASSET_FILE, Asset
from manipose_mj.assets.asset_json import list_assets, read_asset
from manipose_mj.assets.model_file import check_model


def select_assets(chosen: Iterable[Asset | str | Path]) -> tuple[Asset, ...]:
    """The assets that are meant, in the order in which they were named; a folder's by name.

    Args:
      chosen: Assets; names of built-in objects, such as `"mug_003"`; asset folders; folders of asset folders.
        A string with a path separator, or that is a folder, means a folder.

    Raises:
      InputError: There is no built-in object of a name, no asset in a folder, or the model of one cannot be used.
    """
    found: list[Asset] = []
    for each in chosen:
        if not isinstance(each, Asset) and not is_folder(each):
            found.append(catalogue.load_by_name(str(each)))
            continue
        folders = [] if isinstance(each, Asset) else asset_folders(Path(each))
        own = [each] if isinstance(each, Asset) else [read_asset(folder) for folder in folders]
        for asset in own:
            check_model(asset)
        found.extend(own)
    return tuple(found)


def is_folder(chosen: str | Path) -> bool:
    """Whether an object is named by its place on disk rather than by its name in the catalogue."""
    return isinstance(chosen, Path) or "/" in chosen or Path(chosen).is_dir()


def asset_folders(path: Path) -> list[Path]:
    """The asset folder at a path, or those in it.

    Raises:
      InputError: There is none.
    """
    return [path] if (path / ASSET_FILE).is_file() else list_assets(path)
