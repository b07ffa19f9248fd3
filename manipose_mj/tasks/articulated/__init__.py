"""The family `articulated`: open, close, store into and take out of furniture."""
