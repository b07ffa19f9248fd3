"""Handles of furniture: bars, bows, edge pulls, knobs, and how they are mounted."""
