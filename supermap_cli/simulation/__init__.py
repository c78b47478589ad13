"""Simulated worlds: recordings of a robot in rooms, with exact ground truth."""
