"""The generators of the built-in objects; sizes are those of things on sale, and each module names its sources.

`generate(index)` of a module in `axial/`, `mirror/`, `functional/` or `articulated/` returns a `Specimen`: bodies of
`Shape`s with exact label and mass. The modules here are what they are made with: `solids`, `revolution`, `shell`,
`swept`, `extruded`, `sheet`, `moulded` and `turned` make shapes, `pieces` joins them, `vessel`, `filled`, `cutlery`
and `tool_handles` are shared by several categories. `synthetic_furniture/` is for training only.
"""
