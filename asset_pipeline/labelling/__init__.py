"""Pose labels, handles and cavities measured from shapes.

    from asset_pipeline.labelling.scan_label import scan_label

    label, quality = scan_label(mesh, "axial", up)

`scan_label` chooses between `axial_label`, `lying_label`, `mirror_label` and `tool_label`, which measure symmetry
on a `surface_cloud`; `handle_label`, `articulated_label` and `cavities` are for furniture; `overrides/` lets a person
correct what was measured.
"""
