"""Measure `synthroads predict` on a large cloud: points per second, memory, and whether all attributes stay.

    python studies/costs/prediction.py out/segmentation out/demo/cloud.laz --points 15000000 --output out/prediction

lays copies of a LAS or LAZ file side by side until there are enough points, labels them in a process of its own and
compares what was written with what was read, attribute by attribute. `prediction.json` in the output folder says what
came out; the large files are removed unless --keep is given.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
from collections import Counter
from copy import deepcopy
from pathlib import Path
from typing import Any

import laspy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from ml.segmentation.prediction import BLOCK  # noqa: E402
from synthroads_addon.base.errors import InputError, MissingFileError, SynthRoadsError  # noqa: E402
from synthroads_addon.base.files import write_file  # noqa: E402
from synthroads_addon.base.schema import canonical_json  # noqa: E402
from synthroads_addon.cloud.layers import PREDICTED  # noqa: E402

RESULT = "prediction.json"
_GAP = 2.0
"""Between copies, m."""
_GROWING = (("LASF_Spec", 4), ("laszip encoded", 22204))
_HEADER_FIELDS = (
    "version",
    "system_identifier",
    "generating_software",
    "creation_date",
    "file_source_id",
    "uuid",
    "global_encoding",
    "scales",
    "offsets",
    "mins",
    "maxs",
    "number_of_points_by_return",
)


def tile_cloud(source: Path, target: Path, points: int) -> int:
    """Write copies of a cloud side by side until there are `points`, the last one cut; return the number of copies.

    Records are copied bit by bit but for x and y; memory holds one block of them.

    Raises:
        MissingFileError: there is no such file.
        InputError: it has no points, or their copies don't fit into LAS's whole numbers.
    """
    if not source.is_file():
        raise MissingFileError(str(source), None, "no such file")
    with laspy.open(source) as reader:
        header = deepcopy(reader.header)
        count = int(header.point_count)
        if count == 0:
            raise InputError(str(source), 0, "has no points")
    copies = math.ceil(points / count)
    columns = math.ceil(math.sqrt(copies))
    step = np.ceil((header.maxs - header.mins)[:2] / header.scales[:2] + _GAP / header.scales[:2]).astype(np.int64)
    highest_number = np.abs((np.array([header.maxs, header.mins]) - header.offsets) / header.scales)[:, :2].max()
    if highest_number + columns * step.max() >= 2**31:
        raise InputError("--points", points, "needs more copies than LAS has room for: give a larger cloud")
    points_left = points
    with laspy.open(target, "w", header=header, do_compress=target.suffix.lower() == ".laz") as writer:
        for copy in range(copies):
            with laspy.open(source) as reader:
                for record in reader.chunk_iterator(BLOCK):
                    part = record[: min(points_left, len(record))]
                    part.array["X"] += (copy % columns) * step[0]
                    part.array["Y"] += (copy // columns) * step[1]
                    writer.write_points(part)
                    points_left -= len(part)
                    if not points_left:
                        return copies
    return copies


def differences(before: Path, after: Path) -> list[str]:
    """Return the sorted names of attributes, header fields and records that differ in a labelled copy of a LAS file.

    The attribute for the class is looked at only if the first file has it not: it must be there.
    """
    changed_names: set[str] = set()
    with laspy.open(before) as reader_before, laspy.open(after) as reader_after:
        if reader_before.header.point_count != reader_after.header.point_count:
            return ["number of points"]
        for name in _HEADER_FIELDS:
            field_before, field_after = (getattr(reader.header, name) for reader in (reader_before, reader_after))
            if not np.array_equal(
                getattr(field_before, "value", field_before), getattr(field_after, "value", field_after)
            ):
                changed_names.add(f"header: {name}")
        changed_names |= {
            f"record {owner} {number}" for owner, number, _ in _records(reader_before) - _records(reader_after)
        }
        if PREDICTED not in reader_after.header.point_format.dimension_names:
            changed_names.add(PREDICTED)
        for block_before, block_after in zip(
            reader_before.chunk_iterator(BLOCK), reader_after.chunk_iterator(BLOCK), strict=True
        ):
            names = [name for name in block_before.array.dtype.names if name != PREDICTED]
            changed_names |= {
                name for name in names if not np.array_equal(block_before.array[name], block_after.array[name])
            }
    return sorted(changed_names)


def _records(file: laspy.LasReader) -> Counter[tuple[str, int, bytes]]:
    """Return a multiset of a LAS file's records, without the extra-attribute list and LAZ's own, which grow."""
    all_records = [*file.header.vlrs, *(file.evlrs or [])]
    fixed_records = [record for record in all_records if (record.user_id, record.record_id) not in _GROWING]
    return Counter((record.user_id, record.record_id, record.record_data_bytes()) for record in fixed_records)


def measure(run: Path, source: Path, folder: Path, points: int) -> dict[str, Any]:
    """Label a cloud enlarged to `points` in a separate process; return time, memory and changes as JSON data.

    Raises:
        SynthRoadsError: the labelling failed, with its message.
    """
    folder.mkdir(parents=True, exist_ok=True)
    large_cloud, labelled_cloud = folder / "large.laz", folder / "labelled.laz"
    copies = tile_cloud(source, large_cloud, points)
    command = [sys.executable, "-m", "headless.predict", str(run.resolve()), str(large_cloud.resolve())]
    command += ["--output", str(labelled_cloud.resolve()), "--overwrite", "--json"]
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if process.returncode:
        raise SynthRoadsError(process.stderr.strip())
    report = json.loads(process.stdout)
    with laspy.open(large_cloud) as reader:
        attributes = len(list(reader.header.point_format.dimension_names))
    return {
        "points": report["points"],
        "copies": copies,
        "seconds": report["seconds"],
        "points_per_second": report["points_per_second"],
        "peak_memory_mb": report["peak_memory_mb"],
        "attributes": attributes,
        "changed": differences(large_cloud, labelled_cloud),
        "classes": report["classes"],
        "bytes": large_cloud.stat().st_size,
    }


def main(words: list[str] | None = None) -> None:
    """Measure the prediction as the command line says, write prediction.json and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path, help="folder of a trained segmentation")
    parser.add_argument("cloud", type=Path, help="LAS or LAZ file that is laid side by side")
    parser.add_argument("--points", type=int, default=15_000_000, metavar="N", help="points to label (15000000)")
    parser.add_argument("--output", type=Path, required=True, metavar="DIR", help="folder for the result")
    parser.add_argument("--keep", action="store_true", help="keep the two large files")
    arguments = parser.parse_args(words)
    if arguments.points < 1:
        parser.error("--points must be 1 or more")
    try:
        result = measure(arguments.run, arguments.cloud, arguments.output, arguments.points)
        write_file(arguments.output / RESULT, canonical_json(result).encode(), overwrite=True)
    except SynthRoadsError as error:
        raise SystemExit(str(error)) from None
    if not arguments.keep:
        for name in ("large.laz", "labelled.laz"):
            (arguments.output / name).unlink()
    print(canonical_json(result))


if __name__ == "__main__":
    main()
