"""Effects that change what a pulse meets before its returns are formed."""
