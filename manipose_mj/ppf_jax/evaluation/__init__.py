"""Estimates over sets of clouds, and how far they are from the truth."""
