"""Bodies, joints and cavities of furniture, assembled from portions."""
