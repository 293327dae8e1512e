"""The window in other languages: complete, nothing left over, with the same holes, and told to Blender."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import bpy
import pytest

import synthroads_addon
from synthroads_addon.base.classes import classes
from synthroads_addon.base.errors import InputError
from synthroads_addon.checking.checker import RULES
from synthroads_addon.ui.fields import room
from synthroads_addon.ui.fields.wording import title_case
from synthroads_addon.ui.panels import panels
from synthroads_addon.ui.translations import blender as translations
from synthroads_addon.ui.translations.catalogue import FOLDER, Catalogue, languages, pattern_of
from synthroads_addon.ui.work.common import panel_message
from tests.helpers.scenes.fake_layout import drawn
from tools import translations as tool
from tools.library_messages import Module, data_messages, library_messages

HOLE = re.compile(r"\{\d\}")
TERMS = (
    "Straße",
    "Fahrstreifen",
    "Querschnitt",
    "Schutzplanke",
    "Leitpfosten",
    "Standstreifen",
    "Verkehrszeichenbrücke",
)


@pytest.fixture(autouse=True)
def add_on() -> Iterator[None]:
    """Register the add-on for one test."""
    synthroads_addon.register()
    yield
    synthroads_addon.unregister()


def messages(language: str) -> dict[str, str]:
    return dict(json.loads((FOLDER / f"{language}.json").read_text(encoding="utf-8")))


def test_german_is_there() -> None:
    assert "de" in languages()


@pytest.mark.parametrize("language", languages())
def test_every_message_is_translated_and_none_is_left_over(language: str) -> None:
    """`python tools/translations.py --write` adds what is missing with empty translations, to be filled in."""
    needed = translations.registered_messages() | tool.source_messages() | library_messages() | data_messages()
    missing, left_over = tool.compare(messages(language), needed | tool.drawn_messages())
    assert missing == []
    assert left_over == []


def test_what_lacks_and_what_is_left_over_is_named() -> None:
    lacking, left_over = tool.compare({"Length": "Länge", "Own {0}": "{0} angeben", "Old": "Alt"}, {"Own Width"})
    assert (lacking, left_over) == (["Width"], ["Length", "Old"])


@pytest.mark.parametrize("language", languages())
def test_translations_have_the_holes_of_their_messages(language: str) -> None:
    for text, translation in messages(language).items():
        assert set(HOLE.findall(text)) == set(HOLE.findall(translation)), text
        assert translation.strip() == translation != "", text
    assert list(messages(language)) == sorted(messages(language))


def test_german_uses_the_terms_of_road_building() -> None:
    text = "\n".join(messages("de").values())
    for term in (*TERMS, "Station", "Achse", "Klothoide", "Querneigung"):
        assert term in text, term


def test_patterns_translate_what_they_hold() -> None:
    catalogue = Catalogue({"{0} of {1} points": "{0} von {1} Punkten", "Own {0}": "{0} angeben", "Length": "Länge"})
    assert catalogue.translate("3 of 12 points") == "3 von 12 Punkten"
    assert catalogue.translate("Own Length") == "Länge angeben"
    assert catalogue.translate("Own Width") == "Width angeben"
    assert catalogue.translate("nothing") is None
    assert pattern_of("a {0} (b)").fullmatch("a x (b)")


@pytest.fixture
def german(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have texts said in German: the package bpy has no languages of its own to choose from."""
    monkeypatch.setattr(translations, "locale", lambda: "de_DE")


def test_blender_is_told_all_labels_and_tooltips(monkeypatch: pytest.MonkeyPatch) -> None:
    told: dict[str, dict[tuple[str, str], str]] = {}
    monkeypatch.setattr(translations, "_tell", told.update)
    translations.register()
    assert sorted(told) == ["de", "de_DE"]
    assert told["de_DE"]["Operator", "Build Road"] == "Straße bauen"
    assert told["de_DE"]["*", "Guardrail Height Minimum"] == "Höhe der Schutzplanke: Minimum"
    for text in translations.registered_messages():
        assert ("*", text) in told["de_DE"], text


def test_blenders_own_words_dont_stand_for_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blender calls Median a mean value and Exit the end of a program: our labels have a context of their own."""
    told: dict[str, dict[tuple[str, str], str]] = {}
    monkeypatch.setattr(translations, "_tell", told.update)
    translations.register()
    assert told["de_DE"][translations.CONTEXT, "Median"] == "Mittelstreifen"
    assert told["de_DE"][translations.CONTEXT, "Exit"] == "Ausfahrt"
    number = 0
    for cls in translations._classes():
        if issubclass(cls, bpy.types.Panel | bpy.types.Menu):
            assert cls.bl_translation_context == translations.CONTEXT, cls
        declared = {name: item for base in cls.__mro__ for name, item in getattr(base, "__annotations__", {}).items()}
        for name, item in translations.rna_of(cls).properties.items():
            if isinstance(declared.get(name), bpy.props._PropertyDeferred):
                assert item.translation_context == translations.CONTEXT, (cls, name)
                number += 1
    assert number > 300


@pytest.mark.usefixtures("german")
def test_drawn_texts_are_german() -> None:
    assert translations.said("12,345 points written") == "12,345 Punkte geschrieben"
    assert translations.said("Own Length") == "Länge angeben"
    cls = next(c for c in panels.CLASSES if issubclass(c, panels.MainPanel))
    assert "Unten ein Szenario wählen" in " ".join(drawn(cls, bpy.context).lines)


def test_texts_of_the_library_are_followed_to_where_they_are_written(tmp_path: Path) -> None:
    """Through names, arguments, conditions and sums; what stands in holes beside each other counts as one."""
    path = tmp_path / "module.py"
    path.write_text(
        """
_LONG = "must be short"

def refuse(name, allowed):
    raise InputError(name, 1, allowed)

def check(value, kind):
    refuse("a", f"must be at most {value:g} m{kind}{value}")
    text = _LONG if value else "must be " + "long"
    raise MissingFileError("b", None, text)

def remark(path):
    warn("%s has %d lines", path, 2)
    yield Finding("road", 0.0, 1.0, 2.0, "The radius is small.")
""",
        encoding="utf-8",
    )
    assert set(Module(path).messages()) == {
        "must be at most {0} m{1}",
        "must be short",
        "must be long",
        "{0} has {1} lines",
        "The radius is small.",
    }


@pytest.mark.usefixtures("german")
def test_errors_are_german_with_the_panels_labels() -> None:
    assert panel_message(InputError("File", None, "choose a file")) == "Datei: eine Datei wählen"
    message = panel_message(InputError("road.length", 3, "must be 5 or more (--overwrite replaces it)"))
    assert message.startswith("Länge")
    assert " ist 3: " in message
    assert "„Dateien ersetzen“" in message
    assert "--" not in message


@pytest.mark.usefixtures("german")
def test_rules_and_classes_are_german() -> None:
    for rule in RULES.values():
        assert translations.said(rule.title) != rule.title, rule.id
    for row in classes():
        assert translations.said(title_case(row.name)) != title_case(row.name), row.name
    text = "The curvature jumps by 1.25e-03 1/m: a transition curve is missing (RAA)."
    assert translations.said(text) == "Die Krümmung springt um 1.25e-03 1/m: ein Übergangsbogen fehlt (RAA)."


def test_english_stays_english() -> None:
    assert translations.said("12 points written") == "12 points written"


@pytest.mark.usefixtures("german")
@pytest.mark.parametrize("width", [200.0, 300.0])
def test_no_german_text_is_cut(width: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Names of values, buttons, flags and texts are wrapped by their German width."""
    monkeypatch.setattr(room, "sidebar_width", lambda: width)
    for name in ("MainPanel", "RoadPanel", "ScannerPanel", "OutputPanel"):
        cls = next(c for c in panels.CLASSES if issubclass(c, getattr(panels, name)))
        assert drawn(cls, bpy.context).lines, name
    for text in translations.registered_labels():
        assert all(room.fits(line) for line in room.text_lines(translations.said(text))), text


def test_other_languages_are_added_by_a_file_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from synthroads_addon.ui.translations import catalogue

    (tmp_path / "fr.json").write_text(json.dumps({"Road": "Route"}), encoding="utf-8")
    monkeypatch.setattr(catalogue, "FOLDER", tmp_path)
    catalogue.catalogue_of.cache_clear()
    try:
        found = catalogue.catalogue_of("fr_FR")
        assert found is not None
        assert found.translate("Road") == "Route"
        assert catalogue.catalogue_of("es") is None
    finally:
        catalogue.catalogue_of.cache_clear()
