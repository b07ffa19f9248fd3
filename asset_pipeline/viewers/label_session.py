"""Going through labels and putting them right: what the viewer's buttons do, without a viewer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from asset_pipeline.build.relabel import measured, overridden_as_seen, relabelled
from asset_pipeline.labelling.overrides.applying import moved
from asset_pipeline.labelling.overrides.other_axes import symmetries_along
from asset_pipeline.labelling.overrides.reading import (
    FrameOverride,
    parsed,
    read_entries,
)
from asset_pipeline.labelling.overrides.writing import put_entry
from manipose_mj.assets.asset import Asset
from manipose_mj.assets.asset_json import list_assets, read_asset
from manipose_mj.assets.label import PoseLabel
from manipose_mj.assets.symmetry_names import SYMMETRIES, symmetry_name
from manipose_mj.errors import InputError, unknown_name

# What is moved: the object's own label, else the handle of the part of this name.
OBJECT = "object"
DIGITS = 6  # of what is saved: micrometres


class LabelSession:
    """The assets of a folder, one of them open, and the label of it that is being moved.

    Attributes:
      labels: The file that is saved to.
      names: Of all assets, the least certain label first; what has no confidence comes last.
      asset: The open one, as its folder is.
      target: What is moved: `OBJECT` or the name of a part with a handle.
      label: The moved label.
    """

    def __init__(self, directory: Path, labels: Path) -> None:
        """Open the first asset.

        Raises:
          InputError: The folder has no assets, one cannot be read, or the file is wrong.
        """
        self.labels = labels
        if labels.exists():
            read_entries(labels)
        assets = [read_asset(folder) for folder in list_assets(directory)]
        self._folders = {a.folder.name: a.folder for a in sorted(assets, key=_uncertainty)}
        self.names = tuple(self._folders)
        self.open(self.names[0])

    def open(self, name: str) -> None:
        """Show another asset; what was not saved is forgotten.

        Raises:
          InputError: There is none of this name, or it cannot be read.
        """
        if name not in self._folders:
            raise unknown_name("asset", name, self.names)
        self.asset = read_asset(self._folders[name])
        self.select(OBJECT)

    def step(self, count: int) -> None:
        """Open the asset so many places on, from the last again to the first."""
        index = self.names.index(self.asset.folder.name)
        self.open(self.names[(index + count) % len(self.names)])

    @property
    def targets(self) -> tuple[str, ...]:
        """What can be moved: the object's label, and handles by their parts."""
        return (OBJECT, *(part.name for part in self.asset.parts if part.handle is not None))

    def select(self, target: str) -> None:
        """Move this label from now on; what was not saved of the other is forgotten."""
        if target not in self.targets:
            raise unknown_name("label", target, self.targets)
        self.target = target
        self.reset()

    def reset(self) -> None:
        """The label as it is saved."""
        self.label = self._label_of(self.asset)

    def reset_to_measured(self) -> None:
        """The label as it was measured, before any person moved it."""
        self.label = self._label_of(measured(self.asset))

    def turn(self, axis: int, degrees: float) -> None:
        """Turn the label about its own X, Y or Z (0, 1, 2)."""
        self._move(FrameOverride(turn=np.deg2rad(degrees) * np.eye(3)[axis]))

    def shift(self, axis: int, metres: float) -> None:
        """Shift the label along its own X, Y or Z (0, 1, 2)."""
        self._move(FrameOverride(shift=metres * np.eye(3)[axis]))

    def place(self, pose: Float[np.ndarray, "4 4"]) -> None:
        """Put the label's frame at `T_mesh_label`."""
        self._move(FrameOverride(origin=pose[:3, 3].copy(), rotation=pose[:3, :3].copy()))

    def set_symmetry(self, name: str) -> None:
        """Say what group the shape has: a key of `SYMMETRIES`."""
        if name not in SYMMETRIES:
            raise unknown_name("symmetry", name, SYMMETRIES)
        self.label = replace(self.label, symmetry=SYMMETRIES[name], print_symmetry=None)

    @property
    def shown(self) -> Asset:
        """The open asset with the moved label, unsaved."""
        if self.target == OBJECT:
            return replace(self.asset, label=self.label)
        return replace(
            self.asset,
            parts=tuple(
                replace(part, handle=self.label) if part.name == self.target else part
                for part in self.asset.parts
            ),
        )

    def save(self) -> None:
        """Write the label into the labels file and the asset; a label saved unmoved is confirmed.

        Raises:
          InputError: What else the file says of the object cannot be applied; nothing is written.
        """
        name = self.asset.name
        entries = read_entries(self.labels) if self.labels.exists() else {}
        entry = self._entry(dict(entries.get(name, {})))
        override = parsed(self.labels, name, entry)
        overridden_as_seen(measured(self.asset), override)
        put_entry(self.labels, name, entry)
        self.asset = relabelled(self.asset, override)
        self.reset()

    def forget(self) -> None:
        """Give the asset back what was measured, and take the object out of the labels file.

        Raises:
          InputError: The asset cannot be relabelled; the file stays as it is.
        """
        self.asset = relabelled(self.asset, None)
        if self.labels.exists():
            put_entry(self.labels, self.asset.name, {})
        self.select(OBJECT)

    def _move(self, frame: FrameOverride) -> None:
        """Symmetry goes with the axes: the person sees it beside them, and it is saved with them."""
        symmetry, printed = self.label.symmetry, self.label.print_symmetry
        after = moved(self.label, replace(frame, symmetry=symmetry))
        self.label = replace(after, print_symmetry=printed)

    def _label_of(self, asset: Asset) -> PoseLabel:
        if self.target == OBJECT:
            return asset.label
        handle = asset.part(self.target).handle
        # A person may have added a handle that was not found.
        return self.label if handle is None else handle

    def _entry(self, entry: dict[str, Any]) -> dict[str, Any]:
        """The object's entry with the moved frame in place of any other word on that frame."""
        if self.target == OBJECT:
            return _frame(entry, self.label, measured(self.asset).label)
        parts = dict(entry.get("parts", {}))
        part = dict(parts.get(self.target, {}))
        found = measured(self.asset).part(self.target).handle
        part["handle"] = _frame(dict(part.get("handle", {})), self.label, found)
        return {**entry, "parts": {**parts, self.target: part}}


def _frame(entry: dict[str, Any], label: PoseLabel, found: PoseLabel | None) -> dict[str, Any]:
    """An entry's fields with this frame, and its symmetry where it has a name and is not what was measured.

    Args:
      entry: Of the object or the handle.
      label: As it shall be.
      found: As it was measured; None where a person added it.
    """
    replaced = ("origin", "x", "y", "rotation", "adjust", "symmetry")
    numbers = {"origin": label.origin, "x": label.rotation[:, 0], "y": label.rotation[:, 1]}
    fields: dict[str, Any] = {k: (np.round(v, DIGITS) + 0.0).tolist() for k, v in numbers.items()}
    name = symmetry_name(label.symmetry)
    if name in SYMMETRIES and (found is None or not _follows(label, found)):
        fields["symmetry"] = name
    return fields | {key: value for key, value in entry.items() if key not in replaced}


def _follows(label: PoseLabel, found: PoseLabel) -> bool:
    """Whether the symmetry of the shape and of its print are those that the measured label has in these axes."""
    try:
        symmetry, printed = symmetries_along(found, label.rotation)
    except InputError:
        return False
    own = label.print_symmetry
    alike = symmetry_name(symmetry) == symmetry_name(label.symmetry)
    if printed is None or own is None:
        return alike and printed is own
    return alike and symmetry_name(printed) == symmetry_name(own)


def _uncertainty(asset: Asset) -> tuple[float, str]:
    """Sorts uncertain labels first; what was not measured, or set by a person, comes last."""
    quality = asset.label_quality
    return (2.0 if quality is None else quality.confidence, asset.folder.name)
