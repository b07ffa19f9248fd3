"""Generators of objects that are symmetric about an axis, one module for each category."""
