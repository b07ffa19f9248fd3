"""Rendered views of objects for training and evaluation."""
