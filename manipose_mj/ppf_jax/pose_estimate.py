"""What an estimator says of one object; loads no JAX."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class PoseEstimate:
    """Where an object is.

    Attributes:
      pose: `(4, 4)`, `T_camera_label` [m].
      extents: `(3,)` [m], lengths of the bounding box along the label's axes.
      confidence: Probability that the pose is within 15 deg and 2 cm.
      hypotheses: The other candidates, likeliest first; but those that are within 15 deg and 2 cm of a likelier
        one, up to the network's symmetry, come after all others. None has hypotheses of its own.
    """

    pose: Float[np.ndarray, "4 4"]
    extents: Float[np.ndarray, "3"]
    confidence: float
    hypotheses: tuple[PoseEstimate, ...] = ()
