"""The window in other languages: a catalogue of messages for each, and what Blender is told of them.

A catalogue is a file ``LOCALE.json`` beside this one: English message -> translation, sorted. A message with ``{0}`` is
a pattern: what stands for the braces is translated by itself. `tools/translations.py` lists what a catalogue lacks.
"""
