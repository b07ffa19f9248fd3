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


def test_a_tool_that_changes_up_to_its_end_has_a_joint():
    """Ridges at the far end alone: none is three sections wide, so nothing has departed before the tool ends."""
    ridged = np.where((SHARES > 0.95) & (np.arange(SLICES) % 3 == 0), 0.06, 0.02)
    place, size = joint(
        Sections(SHARES, ridged, np.full(SLICES, 0.1), 0 * SHARES),
        thickness_only=True,
        largest=True,
        step=0.1,
        begun=0.25,
        reach=(0.28, 1.0),
    )
    assert 0.9 < place < 1.0
    assert size > 0.1
