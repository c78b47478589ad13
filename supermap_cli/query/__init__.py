"""Questions in plain words, and their answers; the diff between traversals."""
