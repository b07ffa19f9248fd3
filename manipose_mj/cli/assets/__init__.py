"""The commands `manipose assets list`, `sheet` and `show`, and those that `asset_pipeline` adds."""
