"""Materials: the table, how it varies, and how it reflects."""
