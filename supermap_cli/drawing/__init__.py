"""Pictures of a map drawn with matplotlib: plans from above, and sheets about one thing."""
