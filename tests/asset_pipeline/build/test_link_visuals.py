"""What is seen of links: textures of one name stay apart."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from asset_pipeline.build.link_visuals import Textures, link_visuals
from asset_pipeline.sources.articulated_scan import PartMesh, Surface

WHITE = (1.0, 1.0, 1.0, 1.0)


def _part(image: Path) -> PartMesh:
    mesh = trimesh.creation.box((0.1, 0.1, 0.1))
    mesh.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(mesh.vertices), 2)))
    return PartMesh("board", "board-1", (Surface(mesh, WHITE, image),))


def _image(path: Path, grey: int) -> Path:
    path.parent.mkdir(exist_ok=True)
    Image.new("RGB", (4, 4), (grey, grey, grey)).save(path)
    return path


@pytest.mark.parametrize("links", [[(0, 1, 2)], [(0,), (1, 0), (2, 0)]])
def test_textures_of_one_name_stay_apart(tmp_path, links):
    files = ("a/wood.jpg", "a/wood.png", "b/wood.png")
    images = [_image(tmp_path / file, 80 * i) for i, file in enumerate(files)]
    (tmp_path / "out").mkdir()
    textures = Textures(tmp_path / "out")
    drawn = [link_visuals([_part(images[i]) for i in link], textures) for link in links]
    for link, shapes in zip(links, drawn, strict=True):
        for i, shape in zip(link, shapes, strict=True):
            with Image.open(shape.texture) as seen:
                assert seen.getpixel((0, 0)) == (80 * i,) * 3
    assert drawn[0][0].texture == tmp_path / "out" / "wood.png"
    assert len(list((tmp_path / "out").iterdir())) == 3
