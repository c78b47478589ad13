"""What pushes into a mapping session, such as a recorded bag with all that needs its length, and stores what comes."""
