"""Terminal output and the set-up of worker processes."""
