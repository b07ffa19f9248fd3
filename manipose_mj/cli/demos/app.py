"""The commands under `manipose demos`."""

from __future__ import annotations

from tyro.extras import SubcommandApp

from manipose_mj.cli.demos.export import export_demos
from manipose_mj.cli.demos.record import record_demos
from manipose_mj.cli.demos.replay import replay_demos


def build_app() -> SubcommandApp:
    """The commands under `manipose demos`."""
    app = SubcommandApp()
    app.command(name="record")(record_demos)
    app.command(name="replay")(replay_demos)
    app.command(name="export")(export_demos)
    return app
