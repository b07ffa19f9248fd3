"""Rendered views of furniture for training and evaluation."""
