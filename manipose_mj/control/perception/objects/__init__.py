"""One object as cameras see it: its kind, its views, and shapes, known or completed from its cloud."""
