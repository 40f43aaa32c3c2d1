"""Files in and out: assets loaded, sidecars and documents written."""
