"""The lexicons: data, and the licence of what came from WordNet."""
