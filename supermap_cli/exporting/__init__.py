"""Export of the map to other formats."""
