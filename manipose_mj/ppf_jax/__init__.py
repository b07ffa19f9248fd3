"""Point-pair-feature voting in JAX: from a partial cloud to a 6D pose, extents and a confidence."""
