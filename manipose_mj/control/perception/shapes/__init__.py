"""The shapes of estimated objects, from known ones or from the cloud alone."""
