"""Detectors and segmenters against transformers: small models of random weights, exported, and run by both."""
