"""Merges one map into another: registration, object matching, state merge."""
