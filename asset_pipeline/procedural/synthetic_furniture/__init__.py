"""Random furniture that estimators are trained on; none of it is built as an asset."""
