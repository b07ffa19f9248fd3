"""The control mode `primitive`: one action is a whole motion of the hand."""
