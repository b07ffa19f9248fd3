"""Which doors and drawers of a built piece of furniture nothing can open by their handle."""

from __future__ import annotations

from manipose_mj.assets.asset import Asset

OPENED = ("door", "drawer")  # what bodies that open are named for; see `partnet_mobility.objects`


def handle_remarks(asset: Asset) -> tuple[str, ...]:
    """One line for each door or drawer that has no handle; none for rigid assets."""
    return tuple(
        f"{part.name}: no handle found; tasks that open it refuse it; "
        f"say `parts: {part.name}: handle:` in labels.yaml"
        for part in asset.parts
        if part.handle is None and part.name.split("_")[0] in OPENED
    )
