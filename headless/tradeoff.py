"""Measure error against time for each knob that trades one for the other, on scenes that differ."""

import argparse
import hashlib
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.marked_documents import put_tables
from headless.pictures import can_draw, check_drawable
from headless.progress import progress_bar
from headless.tradeoff_table import TABLES, row_fault, table_texts
from synthroads_addon.base.errors import InputError, OutputError, nearest_name
from synthroads_addon.base.files import check_folder_target, write_file
from synthroads_addon.base.progress import Progress
from synthroads_addon.base.schema import canonical_json, read_json
from synthroads_addon.base.version import generator
from synthroads_addon.jobs.measure.tradeoff import KNOBS, REPEATED, SCENES, knob_rows, row_scenario
from synthroads_addon.scenario.scenario import load_scenario

_ROW = "--row"
_ROWS = "rows"
"""Folder, within the output's, of what is measured already."""
_TABLE = "tradeoff {} {}"
"""Name in the document of a table of a scene: "tradeoff rq31-600m-even colours"."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads tradeoff` to its parser."""
    scenes = ", ".join(SCENES)
    parser.add_argument(
        "--scenario", action="append", metavar="NAME_OR_FILE", help=f"scene to measure on; can be repeated ({scenes})"
    )
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for tables, JSON and plots")
    text = f"settings to measure: {', '.join(KNOBS)} (all)"
    parser.add_argument("--knobs", nargs="+", default=list(KNOBS), metavar="KNOB", help=text)
    parser.add_argument(
        "--resume", action="store_true", help="keep the rows that are in the folder; measure the others"
    )
    parser.add_argument("--overwrite", action="store_true", help="measure the rows in the folder again")
    parser.add_argument("--document", type=Path, metavar="FILE", help="also fill the tables of this Markdown file")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="also write the plots to this folder")
    parser.add_argument(_ROW, metavar="JSON", help=argparse.SUPPRESS)


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads tradeoff`, each row in its own process; return exit code, rows as JSON data, printed tables."""
    if arguments.row:
        from synthroads_addon.jobs.measure.rows import measure_row

        row = json.loads(arguments.row)
        result = measure_row(row["scenario"], row["knob"], row["value"])
        return 0, result, json.dumps(result)
    scenes = list(dict.fromkeys(arguments.scenario or SCENES))
    titles = _check_request(arguments, scenes)
    filled_tables = _filled_tables(arguments)
    progress, has_plots = progress_bar(arguments), can_draw("the plot")
    results = {}

    def measure() -> dict[str, str]:
        """Measure all scenes, write their files, and return the document's tables by name."""
        tables: dict[str, str] = {}
        for number, (scene, title) in enumerate(titles.items()):
            results[title] = _measure_all(arguments, scene, title, _part(progress, number, len(titles)))
            texts = table_texts(results[title], scene)
            tables |= {_TABLE.format(title, table): text for table, text in texts.items()}
            _write(arguments, title, results[title], "\n".join(texts.values()), has_plots=has_plots)
        text_of_table.update(tables)
        return {name: text for name, text in tables.items() if name in names}

    text_of_table: dict[str, str] = {}
    names = [_TABLE.format(title, table) for title in titles.values() for table in filled_tables]
    put_tables(arguments.document, names, measure)
    return 0, {"scenes": results}, "\n".join([*text_of_table.values(), f"written to {arguments.output}"])


def _check_request(arguments: argparse.Namespace, scenes: Sequence[str]) -> dict[str, str]:
    """Raise an error if the request can't be done, before hours of work; return the files' title by scene."""
    titles = {scene: Path(scene).stem for scene in scenes}
    for scene in scenes:
        load_scenario(scene)
        if list(titles.values()).count(titles[scene]) > 1:
            raise InputError("--scenario", scene, "another one has the same name, which its files would have as well")
    for knob in arguments.knobs:
        if knob not in KNOBS:
            raise InputError("--knobs", knob, f"must be any of {', '.join(KNOBS)}{nearest_name(knob, KNOBS)}")
    if arguments.pictures:
        check_drawable("--pictures", arguments.pictures)
    if arguments.resume and arguments.overwrite:
        raise InputError("--resume", None, "can't be given with --overwrite, which keeps nothing")
    file_names = [name for title in titles.values() for name in (_ROWS + "/" + title, f"{title}.json")]
    present_name = next((name for name in file_names if (arguments.output / name).exists()), None)
    if present_name and not arguments.overwrite and not arguments.resume:
        target = str(arguments.output)
        raise OutputError(
            "--output", target, f"already holds {present_name}; --resume keeps it, --overwrite replaces it"
        )
    check_folder_target(arguments.output)
    if arguments.pictures:
        check_folder_target(arguments.pictures, "--pictures")
    return titles


def _filled_tables(arguments: argparse.Namespace) -> list[str]:
    """Return the names of the tables that the document gets: those of the knobs that are asked for.

    Raises:
        InputError: only some of a table's knobs are asked for, so that the document would lose rows of the others.
    """
    if arguments.document is None:
        return []
    filled = []
    for table in TABLES:
        table_knobs = [name for name, knob in KNOBS.items() if knob.table == table]
        absent_knobs = [name for name in table_knobs if name not in arguments.knobs]
        if 0 < len(absent_knobs) < len(table_knobs):
            raise InputError("--knobs", arguments.knobs, f"the table of {table} has {', '.join(absent_knobs)} as well")
        filled += [] if absent_knobs else [table]
    return filled


def _part(progress: Progress, number: int, count: int) -> Progress:
    """Return a callback for a part of the work, of so many equal ones."""

    def show(stage: str, share: float) -> None:
        progress(stage, (number + share) / count)

    return show


def _measure_all(arguments: argparse.Namespace, scene: str, title: str, progress: Progress) -> list[dict[str, Any]]:
    """Measure the rows of the wanted knobs; return these and kept rows of others, in the order of `KNOBS`."""
    chosen_rows = set(knob_rows(arguments.knobs))
    results = []
    for number, (knob, value) in enumerate(knob_rows(KNOBS)):
        progress(f"{title} {knob} {value}", number / len(list(knob_rows(KNOBS))))
        path = arguments.output / _ROWS / title / f"{knob}-{_file_name(value)}.json"
        job = _fingerprint(scene, knob, value)
        result = _read_kept_row(path, job, knob, value) if arguments.resume else None
        if result is None and (knob, value) in chosen_rows:
            result = _measure_row(scene, knob, value)
            write_file(path, canonical_json({"job": job, "row": result}).encode(), overwrite=True)
        if result is not None:
            results.append(result)
    return results


def _file_name(value: Any) -> str:
    """Return a setting's value as a part of a file's name."""
    return str(value).replace(", ", "-").replace("=", "-")


def _fingerprint(scene: str, knob: str, value: Any) -> str:
    """Return a hash of a row's scenario and the program's version, to recognise rows measured for the same job."""
    scenario_text = row_scenario(scene, knob, value).to_json()
    return hashlib.sha256(f"{generator()} {scenario_text}".encode()).hexdigest()


def _read_kept_row(path: Path, job: str, knob: str, value: Any) -> dict[str, Any] | None:
    """Return a row measured earlier for the same job, or None if there is none or it couldn't be measured.

    Raises:
        InputError: the file is damaged.
    """
    if not path.exists():
        return None
    data = read_json(path)
    if isinstance(data, dict) and data.get("job") != job:
        return None
    row = data.get("row") if isinstance(data, dict) else None
    if isinstance(row, dict) and "left_out" in row:
        return None
    if fault := row_fault(row, knob, value):
        raise InputError(f"{path}: row", None, f"{fault}: it is damaged; without the file it is measured again")
    return row


def _measure_row(scene: str, knob: str, value: Any) -> dict[str, Any]:
    """Measure a row, as often as `REPEATED` says; return the fastest, with the seconds of all in `all_seconds`."""
    measurements = [_measured_once(scene, knob, value) for _ in range(REPEATED.get(knob, 1))]
    if len(measurements) == 1 or "left_out" in measurements[0]:
        return measurements[0]
    return min(measurements, key=lambda row: row["seconds"]) | {"all_seconds": [row["seconds"] for row in measurements]}


def _measured_once(scene: str, knob: str, value: Any) -> dict[str, Any]:
    """Measure a row in a process of its own, and return it."""
    request = json.dumps({"scenario": scene, "knob": knob, "value": value})
    line = [sys.executable, str(Path(__file__).resolve()), "--output", ".", _ROW, request, "--json"]
    process = subprocess.run(line, capture_output=True, text=True, encoding="utf-8", errors="replace", check=False)
    if process.returncode:
        raise RuntimeError(f"{scene}: {knob} = {value} failed: {process.stderr.strip()}")
    result: dict[str, Any] = json.loads(process.stdout)
    return result


def _write(
    arguments: argparse.Namespace, title: str, results: Sequence[dict[str, Any]], table: str, *, has_plots: bool
) -> None:
    """Write a scene's rows as JSON, its tables, and its plots if they can be drawn."""
    folder: Path = arguments.output
    write_file(folder / f"{title}.json", canonical_json({"rows": results}).encode(), overwrite=True)
    write_file(folder / f"{title}.md", table.encode(), overwrite=True)
    if not has_plots:
        return
    from headless.tradeoff_plot import plot

    picture = folder / f"{title}.png"
    plot(results, picture)
    if arguments.pictures:
        write_file(arguments.pictures / f"tradeoff-{title}.png", picture.read_bytes(), "--pictures", overwrite=True)


if __name__ == "__main__":
    entry("tradeoff")
