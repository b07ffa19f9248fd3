"""`manipose pose`: train, evaluate and score pose estimators."""

from __future__ import annotations

from tyro.extras import SubcommandApp

from manipose_mj.cli.pose.articulated import evaluate_articulated, train_articulated
from manipose_mj.cli.pose.average import average_weights
from manipose_mj.cli.pose.evaluate import evaluate_pose
from manipose_mj.cli.pose.export import export_views
from manipose_mj.cli.pose.score import score_results
from manipose_mj.cli.pose.train import train_pose


def build_app() -> SubcommandApp:
    """The commands under `manipose pose`."""
    app = SubcommandApp()
    app.command(name="train")(train_pose)
    app.command(name="average")(average_weights)
    app.command(name="evaluate")(evaluate_pose)
    app.command(name="export")(export_views)
    app.command(name="score")(score_results)
    app.command(name="train-articulated")(train_articulated)
    app.command(name="evaluate-articulated")(evaluate_articulated)
    return app
