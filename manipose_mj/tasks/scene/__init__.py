"""The scene's state as arrays, its reader, and where objects wait and rest."""
