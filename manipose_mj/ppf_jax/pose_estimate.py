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
      confidence: Probability that the pose is within 15 deg and 2 cm. Calibrated of the first answer only; of a
        hypothesis it is an upper bound, by itself: all may add up to more than 1.
      hypotheses: The other candidates; of one camera by expected rotation error, the least first. But those that are within 15 deg
        and 2 cm of an earlier one, up to the network's symmetry, come after all others. None has hypotheses of its
        own.
    """

    pose: Float[np.ndarray, "4 4"]
    extents: Float[np.ndarray, "3"]
    confidence: float
    hypotheses: tuple[PoseEstimate, ...] = ()
