"""Call every operator of SynthRoads on an empty scene, on a road of 60 m, and after other work on that road.

It prints as JSON what each answers:

    python call_operators.py bl_ext.user_default.synthroads    # the extension, installed in this Blender
    python call_operators.py synthroads_addon                  # the source in the working folder

It is one file that needs Blender's Python with `bpy` and nothing of the tests, so it runs wherever the extension is
installed. Each operator is called without arguments, as by a script in the background: it must finish, cancel, or
refuse in a sentence. Then the module is taken out and put in again. Exit code 1 if any of it ends in a traceback.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import sys
import tempfile
import traceback
from pathlib import Path

import bpy

SCENES = ("empty", "road", "worked")
"""An empty scene; a road of 60 m; that road scanned, its cloud shown, its rules checked and a material compared."""
_SMALL = {"length": 60.0, "half_width": 20.0}
_REFUSED, _POLL = "Error: ", ".poll() "
_NO_REASON = ("failed, context is incorrect", "Operator could not be")


def enable(module: str) -> None:
    """Register the module: an extension by Blender's own preferences, a package of the working folder by itself."""
    if module.startswith("bl_ext."):
        bpy.ops.preferences.addon_enable(module=module)
        if module not in bpy.context.preferences.addons:
            raise RuntimeError(f"{module} could not be enabled")
        return
    sys.path.insert(0, str(Path.cwd()))
    importlib.import_module(module).register()


def disable(module: str) -> None:
    """Undo `enable`."""
    if module.startswith("bl_ext."):
        bpy.ops.preferences.addon_disable(module=module)
    else:
        sys.modules[module].unregister()


def operators() -> list[str]:
    """Return the names of the operators that are registered under ``synthroads``."""
    return sorted(dir(bpy.ops.synthroads))


def scene_files(names: list[str], folder: Path) -> dict[str, Path]:
    """Save the scenes of given names (`SCENES`), with settings of a quick scan; return the files by name."""
    files = {}
    for name in names:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        settings = bpy.context.scene.synthroads
        for field, value in _SMALL.items():
            setattr(settings.road, field, value)
        settings.scan.own_lines_per_second, settings.scan.lines_per_second = True, 20.0
        settings.scan.platform.own_speed, settings.scan.platform.speed = True, 40.0
        settings.colour.source = "material"
        if name != "empty":
            bpy.ops.synthroads.build()
        if name == "worked":
            bpy.ops.synthroads.add_views()
            bpy.ops.synthroads.add_calibration_class()
        files[name] = folder / name / "scene.blend"
        files[name].parent.mkdir()
        bpy.ops.wm.save_as_mainfile(filepath=str(files[name]))
        if name == "worked":
            bpy.ops.synthroads.scan()
    return files


def work_on_road() -> None:
    """Bring the open scene ``worked`` to where it has what operators on results need."""
    bpy.ops.synthroads.show_cloud()
    bpy.ops.synthroads.check_rules()
    bpy.ops.synthroads.compare_intensities()


def call(name: str) -> tuple[str, str]:
    """Call an operator without arguments; return what came of it and the sentence of a refusal, or the traceback.

    What comes of it is ``finished``, ``cancelled``, ``refused`` or ``traceback``.
    """
    try:
        answer = getattr(bpy.ops.synthroads, name)("EXEC_DEFAULT")
    except RuntimeError as error:
        return outcome_of(str(error))
    except Exception:
        return "traceback", traceback.format_exc()
    return ("finished" if "FINISHED" in answer else "cancelled"), ""


def outcome_of(message: str) -> tuple[str, str]:
    """Return what an operator's error says that came of it, and its text without Blender's own beginning."""
    text = message.strip()
    if "Traceback (most recent call last)" in text:
        return "traceback", text
    if text.startswith(_REFUSED):
        text = text.removeprefix(_REFUSED)
    elif _POLL in text:
        text = text.partition(_POLL)[2]
    if not text or "\n" in text or text.startswith(_NO_REASON):
        return "traceback", f"refused without a sentence: {message.strip()}"
    return "refused", text


def rows(scenes: list[str], folder: Path) -> list[dict[str, str]]:
    """Return one row per operator and scene: ``operator``, ``scene``, ``outcome`` and ``text``, see `call`."""
    result = []
    for scene, file in scene_files(scenes, folder).items():
        for name in operators():
            bpy.ops.wm.open_mainfile(filepath=str(file))
            if scene == "worked":
                work_on_road()
            outcome, text = call(name)
            result.append({"operator": f"synthroads.{name}", "scene": scene, "outcome": outcome, "text": text})
    return result


def main() -> int:
    """Do what this file's description says; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("module", help="bl_ext.user_default.synthroads, or synthroads_addon")
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES), help="in which of them (all)")
    parser.add_argument("--output", type=Path, help="write the JSON to this file instead")
    arguments = parser.parse_args()
    enable(arguments.module)
    with tempfile.TemporaryDirectory() as folder:
        found = rows(arguments.scenes, Path(folder))
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    names = operators()
    disable(arguments.module)
    left, again = operators(), []
    if not left:
        enable(arguments.module)
        again = operators()
    text = json.dumps({"operators": found, "left_after_disabling": left, "registered_again": again == names}, indent=1)
    if arguments.output:
        arguments.output.write_text(text, encoding="utf-8")
    else:
        print(text)
    failed = any(row["outcome"] == "traceback" for row in found)
    return int(failed or bool(left) or again != names)


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    os._exit(code)  # without Blender's teardown, in which a process can hang
