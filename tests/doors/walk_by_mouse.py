"""From an empty file to a drawn, furnished, scanned and exported road by night, by mouse and keyboard alone.

Blender runs it at its start, see `by_mouse`. The extension's zip lies in the home folder, that of SynthRoads IFC in
its folder ``ifc``; where neither does, the add-on is registered already. OUT is the folder of what comes of it: a
picture of each step, and ``answers.json`` with the numbered list of actions. An action is a click, a key, one typed
value, one drag or a scroll to something that isn't in sight; to move the mouse is none. The script reads the scene, and
never writes it.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from types import ModuleType
from typing import Any

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Matrix, Vector

sys.path.insert(0, str(Path(__file__).parent))

from by_mouse import OUT, Found, Panels, Region, Steps, until, work
from scan_by_mouse import MODULE, answers, fail, install, write

FOLDER = Path.home() / "walk"
POINTS = ((0.16, 0.0), (0.26, 0.0088), (0.395, -0.0032), (0.53, 0.0088), (0.63, 0.0))
"""Where the view is clicked for the road: shares of its width, from the left and from its middle upwards."""
RADII = {2: "-900", 5: "900", 8: "-900"}
"""Radii that are stated, m, by the elements' numbers from 0."""
SIGNS = ("11/Aalen/1000 m", "11/Aalen/500 m")
SIGN_NUMBER = "448"
PICTURE_SIZE = "25"
"""Size of the picture by night, percent of Blender's resolution: Cycles takes a sixteenth of the time."""
_PATIENCE = 3600.0
_KEYS = {"/": "SLASH", ".": "PERIOD", "-": "MINUS", "_": "MINUS", " ": "SPACE"} | dict(
    zip("0123456789", ["ZERO", "ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT", "NINE"], strict=True)
)
_BIT = 0.4
_FIRST_ROW, _ROW = 17, 21
"""Distances of the first format of an export from the top of its settings, and of the next from it, pixels."""


def module(name: str) -> ModuleType:
    """Return a module of the add-on, installed or registered from its source."""
    base = MODULE if MODULE in sys.modules else "synthroads_addon"
    return sys.modules[f"{base}.{name}"]


class Hand:
    """A user's hand: what it does is counted, listed and pictured."""

    def __init__(self, window: bpy.types.Window) -> None:
        """Begin with no action done."""
        self.window = window
        self.view = Region(window, "VIEW_3D", "WINDOW")
        self.actions: list[str] = []
        answers["actions"] = self.actions

    @property
    def free(self) -> tuple[int, int]:
        """Return a place of the view where nothing lies."""
        region = self.view.region
        return region.x + int(0.3 * region.width), region.y + int(0.8 * region.height)

    def note(self, text: str) -> Steps:
        """Count an action; picture what was before it."""
        yield _BIT
        request = OUT / "shoot.tmp"
        request.write_text(f"walk_{len(self.actions):02d}", encoding="utf-8")
        request.rename(OUT / "shoot")
        yield from until(lambda: not (OUT / "shoot").exists(), "a picture", 120.0)
        self.actions.append(text)
        print(f"{len(self.actions)}. {text}", flush=True)

    def key(self, text: str, key: str, place: tuple[int, int] | None = None, **held: bool) -> Steps:
        """Press a key."""
        yield from self.note(text)
        at = place or self.free
        yield from self.view.move(at)
        yield 0.1
        yield from self.view.press(key, at, key.lower() if len(key) == 1 and not held else "", **held)
        yield _BIT

    def click(self, text: str, place: tuple[int, int], **held: bool) -> Steps:
        """Click at a place."""
        yield from self.note(text)
        yield from self.view.move(place)
        yield 0.2
        yield from self.view.press("LEFTMOUSE", place, **held)
        yield _BIT

    def type(self, text: str, place: tuple[int, int], value: str, *, anew: bool = True) -> Steps:
        """Type a value and Return."""
        yield from self.note(text)
        if anew:
            yield from self.view.press("A", place, ctrl=True)
            yield from self.view.press("BACK_SPACE", place)
        for letter in value:
            shift = {"shift": True} if letter.isupper() else {}
            yield from self.view.press(_KEYS.get(letter, letter.upper()), place, letter, **shift)
        yield 0.6
        yield from self.view.press("RET", place)
        yield 1.0

    def drag(self, text: str, start: tuple[int, int], end: tuple[int, int]) -> Found:
        """Drag from a place to another; return what the view's header said before the mouse was released."""
        yield from self.note(text)
        yield from self.view.move((start[0] - 3, start[1]))
        yield 0.2
        yield from self.view.move(start)
        yield _BIT
        self.view._send("LEFTMOUSE", "PRESS", start)
        yield 0.2
        for n in range(1, 13):
            part = tuple(round(a + (b - a) * n / 12) for a, b in zip(start, end, strict=True))
            yield from self.view.move((part[0], part[1]))
            yield 0.06
        yield from self.note_drag()
        self.view._send("LEFTMOUSE", "RELEASE", end)
        yield 1.0

    def note_drag(self) -> Steps:
        """Picture the drag while it goes on: its label tells the station."""
        yield _BIT
        request = OUT / "shoot.tmp"
        request.write_text("walk_drag", encoding="utf-8")
        request.rename(OUT / "shoot")
        yield from until(lambda: not (OUT / "shoot").exists(), "a picture", 120.0)

    def button(self, region: Region, wanted: str) -> Found:
        """Return the place of a button; scroll to it, as one action, where it isn't in sight."""
        place = None
        for x in region.columns():
            place = place or (yield from region.look(wanted, x))
        if place is None:
            yield from self.note("scroll the sidebar")
            place = yield from region.find(wanted)
        for up in (0, 8, 14, -8):  # what the mouse is over is known a moment late where the window is drawn slowly
            at = (place[0], place[1] + up)
            yield from region.move(at)
            yield _BIT
            if region.under() == wanted:
                return at
        raise LookupError(f"{wanted} has moved")

    def add(self, what: str) -> Steps:
        """Shift+A and the name of what is added."""
        yield from self.key("Shift+A", "A", shift=True)
        yield 0.3
        yield from self.type(f"type {what}, Return", self.free, what, anew=False)

    def cursor(self, share: float) -> Steps:
        """Put the 3D cursor onto the road, right of the axis, at a share of the drawn width."""
        region = self.view.region
        place = (region.x + int(share * region.width), region.y + region.height // 2 - 4)
        yield from self.key(f"Shift + right mouse button at {share:.2f} of the view", "RIGHTMOUSE", place, shift=True)


def finished(what: str) -> Steps:
    """Wait until work in the background has begun and ended."""
    yield 1.0
    yield from until(lambda: module("ui.work.job").running_job() is None, what, _PATIENCE)
    yield 1.5


def steps() -> Steps:
    """Do the whole walk."""
    windows = bpy.context.window_manager.windows
    view = Region(windows[0], "VIEW_3D", "WINDOW")
    yield from view.press("ESC", (view.region.width // 2, 40))  # Blender's greeting is gone; the cube stays selected
    if list(Path.home().glob("synthroads-*.zip")):
        yield from install(windows)
        for archive in (Path.home() / "ifc").glob("*.zip"):
            bpy.ops.extensions.package_install_files(filepath=str(archive), repo="user_default", enable_on_install=True)
    hand = Hand(windows[0])
    times: dict[str, float] = answers.setdefault("seconds", {})
    yield from hand.key("Delete: the cube", "DEL")
    answers["cube"] = "Cube" in bpy.context.scene.objects
    yield from hand.key("N: the sidebar", "N")
    side = Region(windows[0], "VIEW_3D", "UI")
    yield from until(lambda: side.region.width > 100, "the sidebar", _PATIENCE)
    yield 1.0
    yield from tab(hand, side)
    begun = time.monotonic()
    yield from draw(hand)
    times["draw and build"] = time.monotonic() - begun
    yield from state(hand, side)
    yield from place(hand)
    yield from drag_guardrail(hand)
    begun = time.monotonic()
    yield from scan(hand, side)
    times["scan"] = time.monotonic() - begun
    yield from export(hand, windows)
    yield from night(hand)


def tab(hand: Hand, side: Region) -> Steps:
    """Click the sidebar's tab SynthRoads; where it is, is found by trying."""
    yield from hand.note("click the tab SynthRoads")
    for y in side.rows():
        if side.region.active_panel_category == "SynthRoads":
            return
        yield from side.click((side.region.x + side.region.width - 9, y))
    raise LookupError("no tab SynthRoads in the sidebar")


def draw(hand: Hand) -> Steps:
    """Draw a road with three bends, and build it."""
    yield from hand.add("draw road")
    yield 0.5
    region = hand.view.region
    for number, (right, up) in enumerate(POINTS, 1):
        at = (region.x + int(right * region.width), region.y + region.height // 2 + int(up * region.width))
        yield from hand.click(f"click point {number} of the road", at)
    yield from hand.key("Return: build", "RET")
    yield from finished("the road")


def state(hand: Hand, side: Region) -> Steps:
    """State the three arcs in the table, and build the road as edited."""
    yield from hand.note("click the panel Alignment")
    yield from Panels(side, "SYNTHROADS_PT_").open("SYNTHROADS_PT_alignment")
    for number, radius in RADII.items():
        cell = yield from hand.button(side, f"synthroads_alignment.elements[{number}].radius")
        yield from hand.click(f"click the radius of element {number + 1}", cell)
        yield from hand.type(f"type {radius}, Return", cell, radius)
    button = yield from hand.button(side, "synthroads.build_edited")
    yield from hand.click("click Build as Edited", button)
    yield from finished("the stated road")
    answers["radii"] = [row.radius for row in module("ui.alignment.tables").tables.elements if row.kind == "arc"]


def place(hand: Hand) -> Steps:
    """Place an exit, a gantry and two signs with their texts."""
    yield from hand.cursor(0.36)
    yield from hand.add("exit")
    yield from finished("the exit")
    yield from hand.cursor(0.25)
    yield from hand.add("gantry")
    for number, (share, text) in enumerate(zip((0.2, 0.3), SIGNS, strict=True)):
        yield from hand.cursor(share)
        yield from hand.add("traffic sign")
        redo = Region(hand.window, "VIEW_3D", "HUD")
        if redo.region.height < 60:
            middle = (redo.region.x + 40, redo.region.y + redo.region.height // 2)
            yield from hand.click("click Add to Road: its settings", middle)
            yield 0.8
        right = redo.region.x + int(0.6 * redo.region.width)
        low = redo.region.y + 22
        if number == 0:
            yield from hand.click("click Sign Number", (right, low + 23))
            yield from hand.type(f"type {SIGN_NUMBER}, Return", (right, low + 23), SIGN_NUMBER)
            yield 0.5
        yield from hand.click("click Text", (right, low))
        yield from hand.type(f"type {text}, Return", (right, low), text)
        yield 1.0
    things = module("ui.panels.rules").edited_parameters(bpy.context.scene).objects
    answers["things"] = {
        name: {"type": thing.type, "text": list(getattr(thing, "text", ())), "code": getattr(thing, "code", "")}
        for name, thing in things.items()
        if thing.type in ("TrafficSign", "Gantry", "Turnout")
    }


def dots() -> dict[tuple[str, str], Any]:
    """Return the road's dots by kind and thing."""
    scene, active = bpy.context.scene, bpy.context.view_layer.objects.active
    root = module("blender.model.roads").root_of(active, scene)
    return {(dot.kind, dot.name): dot for dot in module("ui.drawing.dots").present_dots(root, scene)[1]}


def drag_guardrail(hand: Hand) -> Steps:
    """Drag a guardrail's end along the road."""
    root = module("blender.model.store").find_road(bpy.context.scene)
    into = Matrix(module("blender.model.roads").world_matrix(root).tolist())
    shown = dots()
    region, space = hand.view.region, hand.view.area.spaces.active
    places: dict[tuple[str, str], tuple[int, int]] = {}
    for key, dot in shown.items():
        at = location_3d_to_region_2d(region, space.region_3d, into @ Vector(dot.place))
        places[key] = (round(at.x) + region.x, round(at.y) + region.y)
    ends = [key for key in shown if key[0] in ("start", "end") and key[1].startswith("guardrail-")]

    def room(key: tuple[str, str]) -> float:
        """Return the distance to the next dot, pixels: the mouse takes the one that is on top."""
        x, y = places[key]
        return min(abs(x - u) + abs(y - v) for other, (u, v) in places.items() if other != key)

    which = max((key for key in ends if 50.0 < shown[key].station < 900.0), key=room)
    start = places[which]
    yield from hand.drag(f"drag the {which[0]} of {which[1]}", start, (start[0] + 30, start[1]))
    answers["guardrail"] = [which[1], shown[which].station, dots()[which].station]


def scan(hand: Hand, side: Region) -> Steps:
    """Choose a folder, scan, and show the cloud."""
    folder = yield from hand.button(side, "synthroads.output")
    yield from hand.click("click Folder", folder)
    yield from hand.type(f"type {FOLDER}, Return", folder, str(FOLDER))
    button = yield from hand.button(side, "synthroads.scan")
    yield from hand.click("click Scan", button)
    yield from finished("the scan")
    button = yield from hand.button(side, "synthroads.show_cloud")
    yield from hand.click("click Show Cloud", button)
    yield from finished("the cloud")
    shown = module("ui.panels.cloud_view").view
    answers["shown"] = [len(shown.cloud), shown.by] if shown.cloud else None


def export(hand: Hand, windows: Any) -> Steps:
    """Write the road as IFC."""
    yield from hand.key("F3", "F3")
    yield from hand.type("type export twin, Return", hand.free, "export twin", anew=False)
    yield from until(lambda: len(windows) > 1, "the file browser", 60.0)
    yield 1.5
    settings, buttons = Region(windows[1], "FILE_BROWSER", "TOOL_PROPS"), Region(windows[1], "FILE_BROWSER", "EXECUTE")
    row = list(module("twin.formats").TWIN_FORMATS).index("ifc")
    area = settings.region
    yield from hand.note("click IFC")
    yield from settings.click((area.x + area.width // 2, area.y + area.height - _FIRST_ROW - _ROW * row))
    yield from hand.note("click Export Model")
    yield from buttons.press_button("file.execute")
    yield from finished("IFC")


def night(hand: Hand) -> Steps:
    """Light the road by night, and make a picture."""
    yield from hand.key("F3", "F3")
    yield from hand.type("type light by night, Return", hand.free, "light by night", anew=False)
    yield 3.0
    redo = Region(hand.window, "VIEW_3D", "HUD")
    if redo.region.height < 50:
        middle = (redo.region.x + 40, redo.region.y + redo.region.height // 2)
        yield from hand.click("click Light by Night: its settings", middle)
        yield 0.8
    size = (redo.region.x + int(0.7 * redo.region.width), redo.region.y + 22)
    yield from hand.note("Return over Picture Size")
    yield from hand.view.move(size)
    yield 0.2
    yield from hand.view.press("RET", size)
    yield from hand.type(f"type {PICTURE_SIZE}, Return", size, PICTURE_SIZE)
    answers["size"] = bpy.context.scene.render.resolution_percentage
    yield from hand.key("F12: the picture", "F12")
    yield 5.0
    yield from until(lambda: not bpy.app.is_job_running("RENDER"), "the picture", _PATIENCE)
    yield from hand.note("(end)")
    hand.actions.pop()
    answers["sun"] = module("ui.panels.rules").edited_parameters(bpy.context.scene).environment.sun_elevation_deg
    result = bpy.data.images.get("Render Result")
    answers["rendered"] = result is not None and not bpy.app.is_job_running("RENDER")
    answers["files"] = sorted(str(path.relative_to(FOLDER)) for path in FOLDER.rglob("*") if path.is_file())


if __name__ == "__main__":
    work(steps(), fail, write)
