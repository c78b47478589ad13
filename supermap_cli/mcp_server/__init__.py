"""A Model Context Protocol server: the memory as tools for agents."""
