"""Domain randomisation: what the fixed scenarios hold constant, varied axis by axis."""
