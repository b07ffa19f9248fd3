"""Calls in processes of their own that are stopped at a limit of time or memory."""
