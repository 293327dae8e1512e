"""How processes of ours are ended: by signals, by the memory that is short, at the end of their work."""
