"""Waypoints: goals in words, the free floor that the robot has seen, and ways across it."""
