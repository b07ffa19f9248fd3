"""The command `manipose`, one module for each subcommand."""
