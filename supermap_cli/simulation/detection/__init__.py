"""A detector that errs as real ones do: misses, look-alikes, bleeding masks, phantoms."""
