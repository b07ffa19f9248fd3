"""Whether training and test objects are of the same kinds."""

from __future__ import annotations

import dataclasses
import importlib
from collections import Counter

import pytest

from manipose_mj.assets.categories import CATALOGUE

RIGID = [row for row in CATALOGUE.values() if row.object_type != "articulated"]


@pytest.mark.parametrize("category", RIGID, ids=lambda row: row.name)
def test_every_common_style_is_in_both_splits(category):
    module = importlib.import_module(category.module)
    counts = {"train": Counter(), "test": Counter()}
    for index in range(category.instances):
        design = module.design(index)
        counts[category.split(index)].update(
            (field.name, value)
            for field in dataclasses.fields(design)
            if isinstance(value := getattr(design, field.name), str)
        )
    for style in counts["train"].keys() | counts["test"].keys():
        train, test = counts["train"][style], counts["test"][style]
        assert train + test < 8 or (train and test), (
            f"{style}: {train} for training, {test} for tests"
        )
