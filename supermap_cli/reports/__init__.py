"""What leaves as a document for people: pages complete in one file, and plans seen from above."""
