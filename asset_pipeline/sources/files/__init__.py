"""Readers of mesh files and archives that check every line: OBJ, MTL, PLY, zip, tar."""
