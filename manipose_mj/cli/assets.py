"""`manipose assets`: the commands about object assets."""

from __future__ import annotations

from tyro.extras import SubcommandApp

from manipose_mj.cli import assets_build, assets_check, assets_list, assets_show


def build_app() -> SubcommandApp:
    """The commands under `manipose assets`."""
    app = SubcommandApp()
    app.command(assets_build.build_assets, name="build")
    app.command(assets_check.check_assets, name="check")
    app.command(assets_list.list_objects, name="list")
    app.command(assets_show.show_asset, name="show")
    return app
