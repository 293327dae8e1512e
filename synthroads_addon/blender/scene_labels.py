"""Custom properties that label any object, ours or a user's."""

CLASS_PROPERTY = "synthroads_class"
"""Custom property of any object: the name of its class."""
INSTANCE_PROPERTY = "synthroads_instance"
"""Custom property of any object: its instance number."""
