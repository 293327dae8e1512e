"""PyYAML's safe loader with what YAML lacks: a limit on what aliases stand for, and no key twice in a mapping.

A module of its own, as PyYAML isn't among the packages of the Blender extension.
"""

import re
from typing import Any

import yaml
from yaml.composer import ComposerError

MOST_NODES = 100_000
"""Values in a file, those that aliases repeat counted each time: nine lines of nested aliases stand for thousands of
millions."""


class Loader(yaml.SafeLoader):
    """PyYAML's safe loader that limits the number of values and allows no key twice in a mapping."""

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._nodes = 0
        self._sizes: dict[str, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Return the next node of a YAML document; ComposerError past `MOST_NODES`, aliases counted in full."""
        event = self.peek_event()
        nodes_before = self._nodes
        if isinstance(event, yaml.AliasEvent):
            self._nodes += self._sizes.get(event.anchor or "", 0)
        self._nodes += 1
        node = super().compose_node(parent, index)
        if self._nodes > MOST_NODES:
            raise ComposerError(None, None, f"more than {MOST_NODES:,} values, with aliases", event.start_mark)
        if not isinstance(event, yaml.AliasEvent) and event.anchor is not None:
            self._sizes[event.anchor] = self._nodes - nodes_before
        return node

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        """Return the next mapping of a YAML document; ComposerError where it has a key twice."""
        node = super().compose_mapping_node(anchor)
        keys = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode) or key.tag == "tag:yaml.org,2002:merge":
                continue
            if (key.tag, key.value) in keys:
                raise ComposerError(None, None, f"the key {key.value!r} is there twice", key.start_mark)
            keys.add((key.tag, key.value))
        return node


# YAML 1.1 takes 1e-3 for text, since it lacks a point; people who write it mean the number.
Loader.add_implicit_resolver("tag:yaml.org,2002:float", re.compile(r"[-+]?\d+[eE][-+]?\d+$"), list("-+0123456789"))
