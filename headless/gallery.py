"""Render the gallery: scenes, every kind of object close up, design classes, and materials with their layers."""

import argparse
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.messages import logger
from headless.progress import progress_bar
from headless.prompt_end import ended_promptly
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.files import check_folder_target


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads gallery` to its parser."""
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for the pictures")
    parser.add_argument("--only", default="", metavar="TEXT", help="only pictures whose name contains this (all)")
    parser.add_argument("--width", type=int, default=1280, metavar="N", help="width of a picture, pixels (1280)")
    parser.add_argument("--samples", type=int, default=48, metavar="N", help="samples per pixel (48)")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads gallery`; return exit code, paths of the pictures as JSON data and printed text."""
    from synthroads_addon.blender.views.gallery import Quality, make_gallery, planned_pictures

    check_folder_target(arguments.output)
    quality = Quality((arguments.width, arguments.width * 9 // 16), arguments.samples)
    picture_count, progress = planned_pictures(arguments.only), progress_bar(arguments)
    if not picture_count:
        raise InputError("--only", arguments.only, "is part of no picture's name, e.g. scene-, object-tree, materials-")
    picture_number = 0

    def say(path: str) -> None:
        """Tell a picture's path and the progress."""
        nonlocal picture_number
        picture_number += 1
        logger.info(path)
        progress("pictures", min(1.0, picture_number / picture_count))

    progress("pictures", 0.0)
    with ended_promptly():
        pictures = make_gallery(arguments.output, quality, arguments.only, say)
    return 0, {"pictures": [str(path) for path in pictures]}, f"{len(pictures)} pictures in {arguments.output}"


if __name__ == "__main__":
    entry("gallery")
