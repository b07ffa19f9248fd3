"""Data sets as their publishers ship them: one module or folder each, and what they yield.

A source is a module with `items(path)`, the objects there; `inputs(item)`, the sha256 of their files; and the
context manager `opened(item)`, which yields a `Scan` or an `ArticulatedScan`. `collection` finds and unpacks for
all; `files/` reads meshes and archives; `drawn_handle` finds handles that are not named so. `meshes` reads files
that no publisher arranged: its `items(path, options)` takes what a person says of them, and `mesh_guesses` guesses the rest.
"""
