"""What is no seed is refused at every front door, before an episode is drawn from it."""

from __future__ import annotations

import numpy as np
import pytest

from manipose_mj import batch, suite
from manipose_mj.errors import InputError
from manipose_mj.tasks.core.config import EpisodeSpec

TASK = ("single_object", "target_pose")


@pytest.mark.parametrize("seed", [-1, 2**32, 1.5, "1"])
def test_an_episode_has_a_32_bit_seed(seed):
    with pytest.raises(InputError, match="expected a whole number from 0 to 4294967295"):
        EpisodeSpec(seed)


def test_seeds_of_numpy_are_seeds():
    assert EpisodeSpec(np.uint32(2**32 - 1)).seed == 2**32 - 1


def test_front_doors_refuse_negative_seeds():
    with pytest.raises(InputError, match="seed is -1; expected"):
        suite.load(*TASK, seed=-1)
    for seed in (-1, 1.5, "a"):
        with pytest.raises(InputError, match=f"seed is {seed!r}; expected"):
            batch.make("/".join(TASK), worlds=1, seeds=(seed,), engine="c")
