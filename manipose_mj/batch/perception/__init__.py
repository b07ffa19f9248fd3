"""What batched worlds see, and the way from there to joint angles."""
