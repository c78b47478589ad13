"""Weights of networks: which can be had from where, under which licence, and where they lie on this machine."""
