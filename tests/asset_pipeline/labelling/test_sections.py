"""Where the sections of a tool leave those of its grip."""

import numpy as np
import pytest

from asset_pipeline.labelling.sections import SLICES, Sections, joint

SHARES = (np.arange(SLICES) + 0.5) / SLICES


def _sections(length: float) -> Sections:
    """A cutter: a grip that thins a little at a third of its length, a flat nose from 80 % on."""
    thin = np.interp(SHARES, [0.32, 0.36, 0.78, 0.82], [0.080, 0.064, 0.060, 0.018])
    wide = np.interp(SHARES, [0.32, 0.36, 0.78, 0.82], [0.130, 0.104, 0.104, 0.090])
    return Sections(length * SHARES, length * thin, length * wide, 0 * SHARES)


@pytest.mark.parametrize("largest", [False, True])
@pytest.mark.parametrize("step", [0.15, 0.33, 0.40])
def test_similar_tools_of_any_size_have_the_joint_at_the_same_share(largest, step):
    found = [
        joint(
            _sections(length),
            thickness_only=False,
            largest=largest,
            step=step,
            begun=0.25,
            reach=(0.28, 0.95),
        )
        for length in (0.06, 0.12, 0.20, 0.40)
    ]
    shares = np.array([place for place, _ in found]) / [0.06, 0.12, 0.20, 0.40]
    assert np.ptp(shares) < 1e-6
    assert np.ptp([size for _, size in found]) < 1e-6
