"""Pictures, plots and galleries show what the package and the tables hold today."""

from __future__ import annotations

import csv
import importlib
import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from manipose_mj.assets.categories import CATALOGUE
from tests.docs.pages import DOCS, read
from tests.places import ROOT

MOST_BYTES = 3_000_000  # of all pictures of the categories
TEASER_BYTES = 1_000_000
MOST_BYTES_STRIPS = 600_000


def script(path: Path):
    """A script's module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def plots():
    return script(DOCS / "plots" / "draw.py")


@pytest.fixture(scope="module")
def gallery():
    return script(ROOT / "benchmarks" / "pictures" / "category_pictures.py")


@pytest.fixture(scope="module")
def manipulation():
    return importlib.import_module("manipulation_table")


def test_the_teaser_moves_and_is_small():
    path = DOCS / "teaser.webp"
    assert path.stat().st_size < TEASER_BYTES
    with Image.open(path) as picture:
        assert getattr(picture, "n_frames", 1) > 40


def test_the_gallery_shows_every_category(gallery):
    folder = DOCS / "categories"
    facts = gallery.facts(folder)
    assert {row["category"]: int(row["instances"]) for row in facts} == {
        name: row.instances for name, row in CATALOGUE.items()
    }
    assert {row["category"]: row["type"] for row in facts} == {
        name: row.object_type for name, row in CATALOGUE.items()
    }
    assert read(folder / "README.md") == gallery.page(facts)
    for name in CATALOGUE:
        with Image.open(folder / f"{name}.webp") as one:
            assert one.size == (gallery.SIZE, gallery.SIZE)
        with Image.open(folder / f"{name}_variants.webp") as strip:
            assert strip.size == (gallery.VARIANTS * gallery.SMALL, gallery.SMALL)
            assert len(set(gallery.variants(name))) == gallery.VARIANTS
    assert sum(path.stat().st_size for path in folder.glob("*.webp")) < MOST_BYTES


def test_a_category_is_drawn_as_in_the_gallery(gallery, tmp_path):
    gallery.draw("bowl", tmp_path)
    for name in ("bowl.webp", "bowl_variants.webp"):
        fresh, committed = (
            np.asarray(Image.open(folder / name).convert("RGB"), int)
            for folder in (tmp_path, DOCS / "categories")
        )
        # Processors round differently, and compression makes half a grey level of it; another category is 30 away.
        assert np.abs(fresh - committed).mean() < 1.0


def test_plots_show_their_tables(plots):
    """Every label of a figure drawn now is in the committed file, and no stand-in colour is left."""
    variables = importlib.import_module("plot_style").VARIABLES
    for figure in plots.FIGURES:
        committed = read(DOCS / "plots" / f"{figure.__name__}.svg")
        fresh = plots.svg(figure(), figure.__name__)
        labels = re.findall(r"<text[^>]*>([^<]+)<", fresh)
        assert labels and labels == re.findall(r"<text[^>]*>([^<]+)<", committed), figure.__name__
        assert not any(colour in committed for colour in variables)
    drawn = {path.stem for path in (DOCS / "plots").glob("*.svg")}
    assert drawn == {figure.__name__ for figure in plots.FIGURES}


def test_a_table_of_a_page_is_that_of_the_plot():
    page = read(DOCS / "results" / "types.md")
    with (DOCS / "plots" / "types.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        line = f"| {row['type']} | {row['category']} | {row['rotation_median_deg']} | {row['origin_median_cm']} |"
        assert line in page


def test_the_page_of_the_protocol_is_that_of_the_cards(manipulation):
    records = manipulation.baseline_records()
    episodes = [each for record in records for each in manipulation.episodes_of(record)]
    results = DOCS / "results"
    assert read(results / "protocol_v1.md") == manipulation.page(episodes, results / "failures")
    assert read(DOCS / "plots" / "protocol_v1.csv") == manipulation.table_csv(episodes)
    failed = {
        manipulation.strip_name(each.result, each.label)
        for each in episodes
        if each.result.failure is not None
    }
    strips = list((results / "failures").glob("*.webp"))
    assert {path.name for path in strips} <= failed
    assert sum(path.stat().st_size for path in strips) < MOST_BYTES_STRIPS
