"""PartNet-Mobility: `objects` is the source; its URDF, meshes and semantics, checked against each other."""
