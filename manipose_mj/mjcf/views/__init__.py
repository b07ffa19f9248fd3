"""Films, thumbnails, contact sheets and the interactive viewer."""
