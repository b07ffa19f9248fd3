"""Markers that show goals in pictures; sensors see none of them."""
