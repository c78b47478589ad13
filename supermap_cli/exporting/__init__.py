"""What leaves the memory for other programs: a file for each format, streamed whatever the memory's size."""
