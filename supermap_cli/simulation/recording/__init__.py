"""The run: everything measured goes into a bag, everything true into the ground truth."""
