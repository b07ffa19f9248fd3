"""From observations to the estimated scene; the oracle beside it."""
