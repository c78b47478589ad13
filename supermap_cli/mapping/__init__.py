"""The mapping engine: visibility, lifting, association, fusion, lifecycle."""
