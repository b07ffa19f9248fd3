"""`manipose pose`: train, evaluate and score pose estimators."""

from __future__ import annotations

from manipose_mj.cli.pose.articulated import evaluate_articulated, train_articulated
from manipose_mj.cli.pose.average import average_weights
from manipose_mj.cli.pose.evaluate import evaluate_pose
from manipose_mj.cli.pose.export import export_views
from manipose_mj.cli.pose.score import score_results
from manipose_mj.cli.pose.train import train_pose
from manipose_mj.console.command_line import CommandApp


def build_app() -> CommandApp:
    """The commands under `manipose pose`."""
    app = CommandApp()
    app.add("train", train_pose)
    app.add("average", average_weights)
    app.add("evaluate", evaluate_pose)
    app.add("export", export_views)
    app.add("score", score_results)
    app.add("train-articulated", train_articulated)
    app.add("evaluate-articulated", evaluate_articulated)
    return app
