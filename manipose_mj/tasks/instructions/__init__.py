"""What an episode asks for, in words."""
