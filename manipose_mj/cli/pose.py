"""`manipose pose`: train and evaluate pose estimators."""

from __future__ import annotations

from tyro.extras import SubcommandApp

from manipose_mj.cli import pose_articulated, pose_average, pose_evaluate, pose_train


def build_app() -> SubcommandApp:
    """The commands under `manipose pose`."""
    app = SubcommandApp()
    app.command(name="train")(pose_train.train_pose)
    app.command(name="average")(pose_average.average_weights)
    app.command(name="evaluate")(pose_evaluate.evaluate_pose)
    app.command(name="train-articulated")(pose_articulated.train_articulated)
    app.command(name="evaluate-articulated")(pose_articulated.evaluate_articulated)
    return app
