"""`manipose assets`: the commands about object assets.

Those that build assets belong to `asset_pipeline`, which this package does not import: they are found as entry
points of the group `manipose_mj.asset_commands`, where anybody may add more.
"""

from __future__ import annotations

from importlib.metadata import entry_points

from manipose_mj.cli.assets.list import list_objects, show_statistics
from manipose_mj.cli.assets.sheet import draw_sheets
from manipose_mj.cli.assets.show import show_asset
from manipose_mj.console.command_line import CommandApp

GROUP = "manipose_mj.asset_commands"


def build_app() -> CommandApp:
    """The commands under `manipose assets`, by name."""
    commands = {
        "list": list_objects,
        "sheet": draw_sheets,
        "show": show_asset,
        "stats": show_statistics,
        **{entry.name: entry.load() for entry in entry_points(group=GROUP)},
    }
    app = CommandApp()
    for name in sorted(commands):
        app.add(name, commands[name])
    return app
