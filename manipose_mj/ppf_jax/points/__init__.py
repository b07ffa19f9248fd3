"""Point clouds: files, normals, symmetric labels, batches."""
