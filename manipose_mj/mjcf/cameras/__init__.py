"""Depth, clouds and pictures by ray casting or GL, and the noise of depth sensors."""
