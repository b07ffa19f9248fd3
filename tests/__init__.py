"""Tests of both packages, in folders that mirror them; helper modules are imported as `tests.<folder>.<module>`."""
