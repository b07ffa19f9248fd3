"""Training of the estimators: losses, loop, curves."""
