"""How good a map is: the field's metrics, each with its source, against ground truth."""
