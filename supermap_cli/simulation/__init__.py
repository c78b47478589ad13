"""Simulated worlds with exact ground truth: a robot's recording of rooms that never were."""
