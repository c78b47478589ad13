"""Answers typed questions (`language.questions`) from a map: one module per kind of question."""
