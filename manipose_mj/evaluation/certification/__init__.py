"""How the baseline solves each start of a protocol: found, kept and replayed."""
