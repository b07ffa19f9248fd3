"""Policies through episodes to results, statistics and reports."""
