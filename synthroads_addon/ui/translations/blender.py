"""Blender is told the translations of all that is registered, and texts are translated before they are measured."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import Any

import bpy

from .catalogue import catalogue_of, languages

_LOCALES = {"de": ("de_DE", "de")}
"""Language -> its locales in Blender."""
CONTEXT = "SynthRoads"
"""Context of our labels and choices: Blender's own words for some, such as Median or Exit, mean other things."""
_CONTEXTS = ("*", "Operator", CONTEXT)
"""Contexts in which Blender looks up tooltips and texts that a layout gives, operators' names, and our labels."""
_PREFIX = "SYNTHROADS_"
_KINDS = ("Operator", "Panel", "Menu", "PropertyGroup", "UIList", "AddonPreferences", "Gizmo", "GizmoGroup")


def registered_messages() -> set[str]:
    """Return all labels, choices and tooltips of the classes that are registered now."""
    return _with_words(text for cls in _classes() for pair in _messages(cls) for text in pair)


def registered_labels() -> set[str]:
    """Return the labels and choices of the classes that are registered now."""
    return _with_words(label for cls in _classes() for label, _ in _messages(cls))


def _with_words(texts: Iterable[str]) -> set[str]:
    """Return the texts that have letters."""
    return {text.strip() for text in texts if any(map(str.isalpha, text))}


def _classes() -> Iterator[type]:
    """Yield our registered classes."""
    for kind in _KINDS:
        waiting = list(getattr(bpy.types, kind).__subclasses__())
        while waiting:
            cls = waiting.pop()
            waiting += cls.__subclasses__()
            if _is_ours(cls) and getattr(cls, "is_registered", False):
                yield cls


def _is_ours(cls: type) -> bool:
    """Return whether a class is one of this add-on's."""
    package = __package__.rpartition(".ui.")[0]
    return cls.__module__.startswith(package) or cls.__name__.startswith(_PREFIX)


def rna_of(cls: Any) -> Any:
    """Return Blender's description of a registered class, with its properties."""
    if issubclass(cls, bpy.types.Operator):
        return getattr(bpy.ops.synthroads, cls.__name__.partition("_OT_")[2]).get_rna_type()
    return cls.bl_rna


def _messages(cls: Any) -> Iterator[tuple[str, str]]:
    """Yield label and tooltip of one class, of its properties, and of their choices."""
    rna = rna_of(cls)
    yield str(getattr(cls, "bl_label", "")), rna.description if issubclass(cls, bpy.types.Operator) else ""
    for name, item in rna.properties.items():
        if not _annotated(cls, name) or item.is_hidden:
            continue
        yield item.name, item.description
        for choice in item.enum_items if item.type == "ENUM" else ():
            yield choice.name, choice.description


def set_translation_context(cls: Any) -> None:
    """Have Blender translate a class's label, and its properties' names and choices, by our catalogue alone.

    Call it before the class is registered.
    """
    if issubclass(cls, bpy.types.Panel | bpy.types.Menu | bpy.types.Operator):
        cls.bl_translation_context = CONTEXT
    for base in cls.__mro__:
        for item in getattr(base, "__annotations__", {}).values():
            if isinstance(item, bpy.props._PropertyDeferred):
                item.keywords.setdefault("translation_context", CONTEXT)


def _annotated(cls: type, name: str) -> bool:
    """Return whether a class or one of its bases declares a property."""
    return any(name in getattr(base, "__annotations__", {}) for base in cls.__mro__)


def register() -> None:
    """Tell Blender the translations of all messages of the registered classes, and of the panel's fixed texts."""
    dictionary: dict[str, dict[tuple[str, str], str]] = {}
    for language in languages():
        catalogue = catalogue_of(language)
        assert catalogue is not None
        texts = registered_messages() | set(catalogue.messages)
        pairs = {text: translation for text in texts if (translation := catalogue.translate(text))}
        entries = {(context, text): translation for text, translation in pairs.items() for context in _CONTEXTS}
        dictionary |= dict.fromkeys(_LOCALES.get(language, (language,)), entries)
    _tell(dictionary)


def _tell(dictionary: dict[str, dict[tuple[str, str], str]]) -> None:
    """Tell Blender translations by locale, context and message."""
    bpy.app.translations.register(__package__, dictionary)


def unregister() -> None:
    """Take the translations back."""
    bpy.app.translations.unregister(__package__)


def said(text: str) -> str:
    """Return a text of the panel in the language of Blender's window, or as it is."""
    return _said(locale(), text)


def locale() -> str:
    """Return the locale of Blender's labels, such as ``de_DE``; empty where they aren't translated."""
    view = bpy.context.preferences.view
    return str(bpy.app.translations.locale or "") if view.use_translate_interface else ""


@lru_cache(maxsize=4096)
def _said(language: str, text: str) -> str:
    """Return a text in the language of a locale, or as it is; cached, as panels are drawn often."""
    catalogue = catalogue_of(language)
    return text if catalogue is None else catalogue.translate(text) or text
