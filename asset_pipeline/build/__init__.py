"""Asset folders from scans and bodies, whole or not at all, in parallel.

    from asset_pipeline.build import build

    results = build("ycb", Path("ycb"), Path("assets"), jobs=8)

`data_set` builds what a source holds; `rigid` and `articulated` give one object what it lacks (stable poses and
grasps; joints, handles and cavities) with `steady_body`, `grasp_trial`, `link_shapes` and `link_visuals`; `emit` writes the folder;
`pool` runs many at once, each in a process of `workers/` with limits; `replaceable` keeps it from removing what is
no asset; `relabel` corrects labels afterwards.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from manipose_mj.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from asset_pipeline.build.data_set import SOURCES, build, build_scan
    from asset_pipeline.build.emit import write_asset
    from asset_pipeline.build.pool import BuildResult
    from asset_pipeline.build.workers.limited_call import Limits

__all__ = ["SOURCES", "BuildResult", "Limits", "build", "build_scan", "write_asset"]

__getattr__ = lazy_exports(__name__, __file__)
