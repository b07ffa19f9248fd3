"""`manipose assets`: the commands about object assets."""

from __future__ import annotations

from tyro.extras import SubcommandApp

from manipose_mj.cli import (
    assets_build,
    assets_check,
    assets_fetch,
    assets_label,
    assets_list,
    assets_relabel,
    assets_sheet,
    assets_show,
)


def build_app() -> SubcommandApp:
    """The commands under `manipose assets`."""
    app = SubcommandApp()
    app.command(name="build")(assets_build.build_assets)
    app.command(name="check")(assets_check.check_assets)
    app.command(name="fetch")(assets_fetch.fetch_assets)
    app.command(name="label")(assets_label.label_assets)
    app.command(name="list")(assets_list.list_objects)
    app.command(name="relabel")(assets_relabel.relabel_assets)
    app.command(name="sheet")(assets_sheet.draw_sheets)
    app.command(name="stats")(assets_list.show_statistics)
    app.command(name="show")(assets_show.show_asset)
    return app
