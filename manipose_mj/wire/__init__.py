"""Talking to methods that run in environments of their own: openpi's framing over websockets."""
