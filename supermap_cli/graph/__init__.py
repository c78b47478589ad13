"""The scene graph: spatial predicates between instances, with intervals and hysteresis."""
