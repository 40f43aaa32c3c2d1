"""The report: one offline page, and the pictures in it."""
