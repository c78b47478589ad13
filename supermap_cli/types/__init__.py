"""Values that pass between the stages: frozen dataclasses over numpy arrays, checked where they are made."""
