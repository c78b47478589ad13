"""Query costs on a large memory: a synthetic building is generated, its memory written, and every query measured."""
