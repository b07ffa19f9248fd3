"""What kind of thing an object is, as an instance detector would tell it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from manipose_mj.assets.asset import Asset
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.assets.label import ObjectType
from manipose_mj.mjcf.objects import RigidObject


@dataclass(frozen=True)
class ObjectKind:
    """All that perception is told about an object.

    Attributes:
      category: Such as `"mug"` or `"stapler"`.
      object_type: Which labelling rule the category follows: whether it is a body of revolution, has a plane of
        symmetry or a functional end.
      in_catalogue: Whether networks and known shapes are the category's; else they are those of any object of its type.
    """

    category: str
    object_type: ObjectType
    in_catalogue: bool


def object_kind(asset: Asset) -> ObjectKind:
    """The kind of an asset, from its category.

    The type of a category of the catalogue is the catalogue's, whatever the single object is. A category that is not
    among them comes with its type, which is as much as the name says to whoever knows the word; nothing else of the
    label is read.
    """
    row = CATALOGUE.get(asset.category)
    if row is not None:
        return ObjectKind(asset.category, row.object_type, True)
    return ObjectKind(asset.category, asset.object_type, False)


def kinds_of(objects: Mapping[str, RigidObject]) -> dict[str, ObjectKind]:
    """The kind of each object of a task, by its name: all that is told about it."""
    return {name: object_kind(entity.asset) for name, entity in objects.items()}
