"""Cache folders, files and folders written whole, and hashes of source code."""
