"""Programs that we export to, one file each."""
