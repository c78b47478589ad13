"""What asking a large memory costs: a building is made up, its memory written, and every kind of question measured."""
