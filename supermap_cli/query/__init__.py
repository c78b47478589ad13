"""Questions about the map in plain words, their answers, and the diff between traversals."""
