"""Observation modes: poses, clouds, images, and the cameras behind them."""
