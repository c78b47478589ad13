"""Who moves through a world, and how: the robot, people, what they carry."""
