"""Reports for people: self-contained HTML pages, and plans from above."""
