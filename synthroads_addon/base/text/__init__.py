"""Text that users type or read: values of fields, tables, names that stand in figures as they are."""
