"""The commands, one module each; a module's `register(app)` adds its own."""
