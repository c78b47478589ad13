"""A simulated detector with the errors of real ones: misses, look-alikes, bleeding masks, phantoms."""
