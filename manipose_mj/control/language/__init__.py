"""Plans from a language model: a description of the scene goes out, a checked plan comes back."""
