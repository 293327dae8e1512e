"""Work the windows of a Blender by mouse and keyboard, from within it; what it needs is Blender's own Python.

Blender is started with ``--enable-event-simulate``. Everything that takes time is a generator that yields the seconds
until it goes on, and `work` runs one by a timer. Buttons are found by what Blender says of the one under the mouse:
its operator, or its property's data path. So nothing here depends on where a panel draws them.
"""

from __future__ import annotations

import os
import time
import traceback
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

import bpy

Steps = Generator[float, None, None]
"""Steps in a window: they yield the seconds until it goes on."""
Found = Generator[float, None, Any]
"""The same, with a result."""

OUT = Path(os.environ["OUT"])
"""Folder of the pictures; window.sh takes one for each file `shoot` in it, and removes that."""
_STEP = 13
"""Distance of the places at which a button or title is looked for, pixels: each is 20 high or more."""
_TITLE = 26
"""From one title to the next where both panels are closed, pixels."""
_PAGE = 6
"""Turns of the mouse wheel between two looks at a region: less than any region's height."""
_NAMES = {"/": "SLASH", ".": "PERIOD", "-": "MINUS", " ": "SPACE"} | dict(
    zip("0123456789", ["ZERO", "ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT", "NINE"], strict=True)
)


def work(steps: Steps, failed: Callable[[str], None], done: Callable[[], None]) -> None:
    """Run steps by a timer, then end Blender: with code 0, or 1 after a last picture where they raised an error.

    Args:
        steps: what is to be done.
        failed: called with the traceback.
        done: called at their end.
    """
    now = [steps]

    def tick() -> float:
        try:
            return next(now[0])
        except StopIteration:
            done()
            os._exit(0)
        except Exception:
            failed(traceback.format_exc())
            now[0] = _leave()
        return 0.1

    bpy.app.timers.register(tick, first_interval=1.0, persistent=True)


def _leave() -> Steps:
    yield from shoot()
    os._exit(1)


def shoot() -> Steps:
    """Have a picture of the screen taken."""
    yield 0.5
    (OUT / "shoot").touch()
    yield from until(lambda: not (OUT / "shoot").exists(), "a picture", 120.0)


def until(condition: Callable[[], Any], what: str, seconds: float) -> Steps:
    """Wait for a condition.

    Raises:
        TimeoutError: it isn't fulfilled within the seconds.
    """
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f"{what}: not within {seconds:.0f} s")
        yield 0.2


class Region:
    """A region of a window, where the mouse moves, clicks and turns its wheel."""

    def __init__(self, window: bpy.types.Window, area: str, region: str) -> None:
        """Take the region of a type, in the window's first area of a type."""
        self.window = window
        self.area = next(item for item in window.screen.areas if item.type == area)
        self.region = next(item for item in self.area.regions if item.type == region)
        self.found = window.height

    def _send(self, kind: str, value: str, place: tuple[int, int], **more: Any) -> None:
        self.window.event_simulate(type=kind, value=value, x=place[0], y=place[1], **more)

    def move(self, place: tuple[int, int]) -> Steps:
        """Move the mouse to a place of the window, pixels from its lower left corner."""
        self._send("MOUSEMOVE", "NOTHING", place)
        yield 0.02

    def click(self, place: tuple[int, int]) -> Steps:
        """Click at a place."""
        yield from self.move(place)
        yield 0.1
        yield from self.press("LEFTMOUSE", place)
        yield 0.3

    def press(self, key: str, place: tuple[int, int], text: str = "", **held: bool) -> Steps:
        """Press a key, or a button of the mouse, of given Blender name while the mouse is at a place."""
        self._send(key, "PRESS", place, **({"unicode": text} if text else {}), **held)
        yield 0.05
        self._send(key, "RELEASE", place)
        yield 0.05

    def write(self, place: tuple[int, int], text: str) -> Steps:
        """Write into the field at a place, instead of what it holds: lower-case letters, digits and ``/ . -``."""
        yield from self.click(place)
        yield from self.press("A", place, ctrl=True)
        yield from self.press("BACK_SPACE", place)
        for letter in text:
            yield from self.press(_NAMES.get(letter, letter.upper()), place, letter)
        yield from self.press("RET", place)
        yield 0.3

    def under(self) -> str:
        """Return what the mouse is over: ``synthroads.scan`` and the like of an operator, or a property's data path."""
        manager = bpy.context.window_manager
        with bpy.context.temp_override(window=self.window, area=self.area, region=self.region):
            if bpy.ops.ui.copy_python_command_button.poll():
                manager.clipboard = ""
                bpy.ops.ui.copy_python_command_button()
                return str(manager.clipboard).removeprefix("bpy.ops.").partition("(")[0]
            held = bpy.context.property
        return held[1] if held else ""

    def rows(self) -> Iterator[int]:
        """Yield the heights in the window at which something may be, from the top."""
        return iter(range(self.region.y + self.region.height - 6, self.region.y + 5, -_STEP))

    def columns(self) -> tuple[int, ...]:
        """Return the places across at which buttons are looked for: values, names, and what stands at the right."""
        return tuple(self.region.x + int(part * self.region.width) for part in (0.7, 0.25, 0.81, 0.9))

    def look(self, wanted: str, x: int) -> Found:
        """Return a place of the button of given operator or data path, of what is in sight in a column; else None.

        It looks first below where something was found before.
        """
        rows = list(self.rows())
        for y in [row for row in rows if row < self.found] + [row for row in rows if row >= self.found]:
            yield from self.move((x, y))
            if self.under() == wanted:
                self.found = y
                return x, y - 2
        return None

    def find(self, wanted: str) -> Found:
        """Return the same of the whole region, scrolled to where it is.

        Raises:
            LookupError: it isn't there.
        """
        place = yield from self.look(wanted, self.columns()[0])
        if place:
            return place
        for x in self.columns():
            yield from self.scroll_to_end(-_PAGE)
            more = 1
            while more:
                place = yield from self.look(wanted, x)
                if place:
                    return place
                more = yield from self.scroll(_PAGE)
        raise LookupError(f"no button of {wanted} in {self.region.type} of {self.area.type}")

    def scroll(self, turns: int) -> Found:
        """Turn the mouse wheel downwards, or upwards where negative; return how far the content moved up, pixels."""
        start = self.bottom()
        middle = (self.region.x + self.region.width // 2, self.region.y + self.region.height // 2)
        yield from self.move(middle)
        for _ in range(abs(turns)):
            self._send("WHEELDOWNMOUSE" if turns > 0 else "WHEELUPMOUSE", "PRESS", middle)
            yield 0.05
        yield 0.3
        return int(start - self.bottom())

    def scroll_to_end(self, turns: int) -> Steps:
        """Turn the wheel as often as it moves anything."""
        while (yield from self.scroll(turns)):
            pass

    def bottom(self) -> float:
        """Return the height of the region's lower edge in what it shows."""
        return float(self.region.view2d.region_to_view(0, 0)[1])

    def press_button(self, wanted: str) -> Steps:
        """Find the button of an operator, and click on it."""
        place = yield from self.find(wanted)
        yield from self.click(place)

    def fill(self, path: str, text: str) -> Steps:
        """Find the field of a property by its data path, and write into it."""
        place = yield from self.find(path)
        yield from self.write(place, text)


class Panels:
    """The panels of a region whose classes' names begin alike; which are open is known by which are drawn."""

    def __init__(self, region: Region, prefix: str) -> None:
        """Note from now on which panels the region draws."""
        self.region = region
        found = [item for item in bpy.types.Panel.__subclasses__() if item.__name__.startswith(prefix)]
        self.classes = {item.__name__: item for item in found if item.is_registered}  # in order of registration
        self.drawn: set[str] = set()
        for name, item in self.classes.items():
            item.append(lambda _panel, _context, name=name: self.drawn.add(name))

    def titles(self, opened: set[str]) -> list[str]:
        """Return the panels whose titles are there, from the top, if these are open."""

        def below(parent: str) -> Iterator[str]:
            own = [name for name, item in self.classes.items() if getattr(item, "bl_parent_id", "") == parent]
            for name in sorted(own, key=lambda name: self.classes[name].bl_order):
                if getattr(self.classes[name], "poll", lambda _context: True)(bpy.context):
                    yield name
                    if name in opened:
                        yield from below(name)

        return list(below(""))

    def opened(self) -> Found:
        """Return the names of the panels that are open, found by having the region drawn."""
        self.drawn.clear()
        end = time.monotonic() + 5.0
        while not self.drawn and time.monotonic() < end:  # none if the outermost is closed
            self.region.region.tag_redraw()
            yield 0.1
        yield 0.2
        return set(self.drawn)

    def open(self, name: str) -> Steps:
        """Open a panel, and those around it, by clicks on their titles.

        What a click opens or closes says whose title is there, and so how far the wanted one is at least. It is looked
        for from the nearer end.

        Raises:
            LookupError: there is no such title.
        """
        if parent := getattr(self.classes[name], "bl_parent_id", ""):
            yield from self.open(parent)
        opened = yield from self.opened()
        if name in opened:
            return
        titles, region = self.titles(opened), self.region
        down = -1 if titles.index(name) > len(titles) // 2 else 1
        yield from region.scroll_to_end(-down * _PAGE)
        low, high = region.region.y + _STEP, region.region.y + region.region.height - _STEP
        x, y = region.region.x + int(0.4 * region.region.width), high if down > 0 else low
        while True:
            while not low <= y <= high:
                moved = yield from region.scroll(down * _PAGE)
                if not moved:
                    raise LookupError(f"the title of {name} isn't there")
                y += moved
            far = yield from self._try(name, (x, y))
            if not far:
                return
            y -= down * far

    def _try(self, name: str, place: tuple[int, int]) -> Found:
        """Click at a place without a button; return 0 if that opens the panel, else how far its title is at least."""
        region = self.region
        yield from region.move(place)
        if region.under():
            return _STEP
        before = yield from self.opened()
        yield from region.click(place)
        after = yield from self.opened()
        if name in after:
            return 0
        yield from region.move((region.window.width // 2, region.window.height // 2))  # a menu closes then
        yield 0.2
        if after == before:
            return _STEP
        yield from region.click(place)  # it was another's title
        titles = self.titles(before)
        other = min(before ^ after, key=titles.index)
        return max(abs(titles.index(name) - titles.index(other)), 1) * _TITLE
