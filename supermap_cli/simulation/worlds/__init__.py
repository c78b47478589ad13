"""What the worlds are made of: the building, shapes, and what stands where."""
