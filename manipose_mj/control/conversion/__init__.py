"""Recorded trajectories converted from one control mode to another."""
