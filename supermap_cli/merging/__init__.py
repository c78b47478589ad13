"""Two memories of one place become one (`supermap db merge`)."""
