"""The family `single_object`: one object to a goal pose, also at a shelf."""
