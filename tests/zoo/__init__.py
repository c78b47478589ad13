"""The bag zoo: small recordings of every kind as people have them, and what becomes of each. See `variants`."""
