"""The zoo's recordings, one table for each family of recorders, drivers, robots and formats."""
