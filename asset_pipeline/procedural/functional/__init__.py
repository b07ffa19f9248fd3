"""Generators of tools, one module for each category."""
