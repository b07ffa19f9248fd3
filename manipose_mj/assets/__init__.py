"""The asset contract: what a built asset is, its folder and JSON, and the built-in catalogue.

An asset folder holds `asset.json`, `model.xml`, `meshes/` and, for rigid objects, `grasps.json`:

    from manipose_mj.assets import catalogue, list_assets, read_asset

    mug = catalogue.load("mug")
    own = [read_asset(folder) for folder in list_assets("assets")]

| modules | hold |
|---|---|
| `asset`, `label`, `label_quality`, `geometry`, `gripper` | the data: assets, labels, bodies, the hand |
| `asset_json`, `label_json`, `grasps_json`, `json_fields` | reading and writing them |
| `categories`, `catalogue`, `inventory` | what is built in, and the one door to `asset_pipeline` |
| `physics`, `rest_scene`, `visible_shapes` | how assets touch, rest and are seen in MuJoCo |
| `label_marks`, `symmetry_names` | how people see and name labels |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from manipose_mj.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from manipose_mj.assets.asset import (
        Area,
        Asset,
        Cavity,
        GraspSet,
        MovingPart,
        Provenance,
        StablePose,
    )
    from manipose_mj.assets.asset_json import list_assets, read_asset, write_asset_json
    from manipose_mj.assets.categories import CATALOGUE, Category
    from manipose_mj.assets.geometry import Body, Joint, MassProperties, Shape
    from manipose_mj.assets.gripper import ParallelJaw
    from manipose_mj.assets.label import OBJECT_TYPES, ObjectType, PoseLabel
    from manipose_mj.assets.label_quality import LabelQuality
    from manipose_mj.assets.symmetry_names import SYMMETRIES, symmetry_name

__all__ = [
    "CATALOGUE",
    "OBJECT_TYPES",
    "SYMMETRIES",
    "Area",
    "Asset",
    "Body",
    "Category",
    "Cavity",
    "GraspSet",
    "Joint",
    "LabelQuality",
    "MassProperties",
    "MovingPart",
    "ObjectType",
    "ParallelJaw",
    "PoseLabel",
    "Provenance",
    "Shape",
    "StablePose",
    "list_assets",
    "read_asset",
    "symmetry_name",
    "write_asset_json",
]

__getattr__ = lazy_exports(__name__, __file__)
