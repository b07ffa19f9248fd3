"""Contact sheets: a tile for each seed, named for what is drawn."""

from __future__ import annotations

import io

from PIL import Image

from benchmarks.pictures.start_sheets import COLUMNS, HEIGHT, WIDTH, Options, drawn, sheet, sheets


def test_a_sheet_has_a_tile_for_each_seed(tmp_path):
    options = Options(tmp_path, ("articulated/open_microwave",), count=COLUMNS + 1, engine="ray")
    ((name, tiles),) = sheets(options)
    assert name == "articulated__open_microwave-starts"
    assert [tile.spec.seed for tile in tiles] == list(range(COLUMNS + 1))
    picture, caption = drawn(tiles[1], options)
    assert picture.shape == (HEIGHT, WIDTH, 3)
    assert caption.startswith("1: ") and "microwave_" in caption
    drawing = Image.open(io.BytesIO(sheet([picture] * (COLUMNS + 1), [caption] * (COLUMNS + 1))))
    assert drawing.format == "JPEG" and drawing.width > COLUMNS * WIDTH
    assert 2 * HEIGHT < drawing.height < 3 * HEIGHT
