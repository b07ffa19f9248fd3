"""Apply a person's labels to asset folders that are built already; rest poses and grasps stay."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from xml.etree import ElementTree

import mujoco

from asset_pipeline.build.emit import numbers
from asset_pipeline.checks.agreement_check import joint_failures, mass_failures
from asset_pipeline.labelling.overrides.applying import overridden
from asset_pipeline.labelling.overrides.reading import Override, read_overrides
from manipose_mj.assets.asset import ASSET_FILE, MODEL_FILE, Asset
from manipose_mj.assets.asset_json import list_assets, read_asset, write_asset_json
from manipose_mj.assets.rest_scene import rest_scene
from manipose_mj.assets.visible_shapes import surface, visible_shapes
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.storage.staging import put_in_place, staging

# What `asset.json` said before a person overrode it.
MEASURED_FILE = "measured.json"
# In an asset's provenance: which entry of the labels file it has.
OVERRIDE = "label override"
# After a rigid asset's digest: rest poses are those of the label before, so that a build is not up to date.
IN_PLACE = " in place"


def relabel(path: Path, labels: Path) -> list[Asset]:
    """Give one asset folder, or all in a folder, the labels that a file says.

    Assets without an entry get back what was measured. Each folder is replaced by one rename.

    Args:
      path: An asset folder, or a folder of asset folders.
      labels: The labels file.

    Returns:
      The assets whose folder changed.

    Raises:
      InputError: A folder or the file cannot be read, an entry cannot be applied, or, for a whole
        folder, an entry is of an object that is not there; or, for an asset without one, of a name much like its own.
    """
    overrides = read_overrides(labels)
    if (path / ASSET_FILE).is_file():
        folders: Sequence[Path] = [path]
        own = read_asset(path).name
        near = [] if own in overrides else get_close_matches(own, overrides, 1)
        if near:
            raise InputError(f"{labels}: {unknown_name('object', near[0], [own])}")
    else:
        folders = list_assets(path)
        there = {read_asset(folder).name for folder in folders}
        for name in overrides:
            if name not in there:
                raise InputError(f"{labels}: {unknown_name('object', name, there)}")
    assets = [read_asset(folder) for folder in folders]
    return [
        relabelled(asset, overrides.get(asset.name))
        for asset in assets
        if not _has(asset, overrides.get(asset.name))
    ]


def relabelled(asset: Asset, override: Override | None) -> Asset:
    """The asset with this override in place of any other one, written to its folder.

    Raises:
      InputError: The override cannot be applied.
    """
    before = measured(asset)
    inputs = {key: value for key, value in before.provenance.inputs.items() if key != OVERRIDE}
    after = before
    if override is not None:
        after = overridden_as_seen(before, override)
        inputs[OVERRIDE] = override.digest + (IN_PLACE if asset.kind == "rigid" else "")
    after = replace(after, provenance=replace(after.provenance, inputs=inputs))
    with staging(asset.folder) as scratch:
        target = scratch / asset.folder.name
        shutil.copytree(asset.folder, target)
        (target / MEASURED_FILE).unlink(missing_ok=True)
        write_asset_json(replace(after, folder=target))
        if override is not None:
            write_measured(target, before)
        _write_model(target / MODEL_FILE, after)
        put_in_place(target, asset.folder)
    return read_asset(asset.folder)


def overridden_as_seen(before: Asset, override: Override) -> Asset:
    """What the override makes of a measured asset, with what is seen in its folder; nothing is written.

    Raises:
      InputError: The override cannot be applied.
    """
    bodies = visible_shapes(before.folder)
    shapes = [shape for own in bodies.values() for shape in own]
    textured = any(shape.texture is not None for shape in shapes)
    if len(shapes) != 1 or (texture := shapes[0].texture) is None:
        return overridden(before, override, surface(bodies), textured=textured)
    try:  # a scan with its print
        return overridden(before, override, shapes[0].surface(), textured=True, texture=texture)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"{texture}: cannot be read as the texture's image ({reason})") from None


def measured(asset: Asset) -> Asset:
    """The asset as it was before a person overrode its label."""
    if not (asset.folder / MEASURED_FILE).is_file():
        return asset
    before = read_asset(asset.folder, MEASURED_FILE)
    return replace(
        asset,
        category=before.category,
        up=before.up,
        label=before.label,
        label_quality=before.label_quality,
        mass_properties=before.mass_properties,
        parts=before.parts,
        areas=before.areas,
    )


def write_measured(folder: Path, before: Asset) -> None:
    """Keep beside an overridden asset what was measured."""
    write_asset_json(replace(before, folder=folder), MEASURED_FILE)


def _has(asset: Asset, override: Override | None) -> bool:
    """Whether the asset is labelled as the override says already."""
    entry = asset.provenance.inputs.get(OVERRIDE)
    if override is None:
        return entry is None
    return entry in (override.digest, override.digest + IN_PLACE)


def _write_model(path: Path, asset: Asset) -> None:
    """Put mass and joints into the model, where they differ.

    Raises:
      InputError: It states them where this cannot change them, such as in another file or in a class.
    """
    place = f"{asset.place}/{MODEL_FILE}"
    tree = ElementTree.parse(path)
    before = path.read_text(encoding="utf-8")
    properties, root = asset.mass_properties, tree.getroot()
    if asset.kind == "rigid":
        inertial = _element(root, "inertial", place)
        for other in ("diaginertia", "quat", "axisangle", "xyaxes", "zaxis", "euler"):
            inertial.attrib.pop(other, None)
        i = properties.inertia
        inertial.set("mass", numbers([properties.mass]))
        inertial.set("fullinertia", numbers([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]))
    for part in asset.parts:
        joint = _element(root, f"joint[@name='{part.name}']", place)
        joint.set("pos", numbers(part.joint.origin))
        joint.set("axis", numbers(part.joint.axis))
    after = ElementTree.tostring(root, encoding="unicode")
    if after != before:
        path.write_text(after, encoding="utf-8")
        _check_written(path, asset, place)


def _element(root: ElementTree.Element, kind: str, place: str) -> ElementTree.Element:
    found = root.find(f".//worldbody//{kind}")
    if found is None:
        raise InputError(f"{place}: cannot be relabelled: it has no {kind}; state it in this file")
    return found


def _check_written(path: Path, asset: Asset, place: str) -> None:
    """Whether MuJoCo reads what was written as it was meant, for example in no frame."""
    try:
        model = rest_scene(path, plane=False)
    except (ValueError, mujoco.FatalError) as error:
        line = " ".join(str(error).split())
        raise InputError(f"{place}: cannot be relabelled: it does not compile: {line}") from None
    rigid = asset.kind == "rigid"
    wrong = mass_failures(asset, model) if rigid else joint_failures(asset, model)
    if wrong:
        raise InputError(f"{place}: cannot be relabelled: {wrong[0]}")
