"""Generators of mirror-symmetric objects, one module for each category."""
