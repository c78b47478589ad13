"""Costs of a build: time by stage, memory and disk space, each measured in a process of its own."""
