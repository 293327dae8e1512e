"""Thin command lines over `synthroads_addon`; each module is one sub-command."""
