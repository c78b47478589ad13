"""Spatial relations, each defined once: what holds between two boxes, by what words, and what needs a viewpoint."""
