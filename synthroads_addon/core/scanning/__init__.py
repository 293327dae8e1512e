"""What a scanner does: devices, patterns, path, beam, returns, radiometry."""
