"""The stages of a mapping session around the mapping engine: poses, depth and placement of frames, perception, lag."""
