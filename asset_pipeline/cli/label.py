"""`manipose assets label`: look at labels in the browser, and put them right."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg


def label_assets(
    directory: Annotated[Positional[Path], arg(metavar="DIR")],
    /,
    *,
    labels: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None,
    host: str = "127.0.0.1",
    port: int = 8080,
) -> None:
    """Show labels on their meshes in the browser, adjust them, and save them.

    The least certain label comes first. Saving writes an entry into the labels file, which later
    builds into DIR read, and rewrites the asset. Ends with Ctrl-C.

    Args:
      directory: Folder of assets.
      labels: YAML file of entries by object name; without it labels.yaml in DIR.
      host: Address to serve on; 0.0.0.0 for all of this machine's.
      port: To serve on; the next free one where it is taken.
    """
    from asset_pipeline.labelling.overrides.reading import LABELS_FILE
    from asset_pipeline.viewers.label_session import LabelSession
    from asset_pipeline.viewers.label_viewer import LabelViewer
    from manipose_mj.console import output

    session = LabelSession(directory, labels or directory / LABELS_FILE)
    with LabelViewer(session, host=host, port=port) as viewer:
        console = output.standard_output()
        console.print(f"{len(session.names)} assets on {viewer.address} (Ctrl-C ends)")
        viewer.wait()
