"""The MJCF of a body that no asset folder holds yet, for trials in simulation."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

from asset_pipeline.build.emit import model_element
from manipose_mj.assets.geometry import Body


@contextmanager
def scratch_model(body: Body) -> Iterator[Path]:
    """The MJCF that the asset folder will hold, but for its visuals, as a file that goes away."""
    with tempfile.TemporaryDirectory(prefix="manipose-model-") as folder:
        root = model_element(body.name, (replace(body, visual=()),), Path(folder))
        path = Path(folder) / "model.xml"
        ElementTree.ElementTree(root).write(path, encoding="unicode")
        yield path
