"""Pieces, carried classes, and whole files labelled in two passes."""

from __future__ import annotations

from pathlib import Path

import laspy
import numpy as np
import pytest
import torch

from headless.predict import labelled
from ml.data.crops import CropSettings, Item
from ml.data.tiles import Scaling
from ml.scores.confusion import Confusion
from ml.segmentation import prediction
from ml.segmentation.prediction import PREDICTED, Labelling, predict_file
from ml.segmentation.scoring import label_tile, nearest_labels, overlapping_pieces, piece_scores
from synthroads_addon.base.classes import UNLABELLED, class_scheme
from synthroads_addon.base.errors import InputError, MissingFileError, OutputError
from synthroads_addon.base.remarks import collected_remarks
from tests.helpers.clouds.road_tiles import road_tile
from tests.helpers.clouds.segmentation_data import road_block, write_cloud

SETTINGS = CropSettings(voxel=0.1)


def by_brightness(batch: Item) -> torch.Tensor:
    """Score classes by intensity: markings are the brightest, roads the darkest."""
    middle = torch.tensor([0.3, 0.15, 0.6, 0.4, 0.5])
    return -(batch["strength"] - middle).abs()


def by_view(batch: Item) -> torch.Tensor:
    """Score class 1 where a point sees others at least 3 m to all sides, else class 0."""
    plan = batch["coord"][:, :2]
    ample = ((plan - plan.amin(dim=0) > 3.0) & (plan.amax(dim=0) - plan > 3.0)).all(dim=1)
    return torch.stack([~ample, ample], dim=1).float()


def test_pieces_hold_every_point_once_and_see_their_margin() -> None:
    plan = np.random.default_rng(1).uniform(0.0, 90.0, (20_000, 2))
    own = plan[:, 0] < 70.0
    counts = np.zeros(len(plan), dtype=int)
    for inside, seen in overlapping_pieces(plan, own, edge=24.0, margin=4.0, largest=10**6):
        counts[inside] += 1
        assert set(inside) <= set(seen)
        low, high = plan[inside].min(axis=0), plan[inside].max(axis=0)
        near = np.all((plan > low - 3.5) & (plan < high + 3.5), axis=1)
        assert set(np.flatnonzero(near)) <= set(seen)
        assert np.all(high - low <= 24.0)
    assert (counts == own).all()


def test_crowded_pieces_are_cut() -> None:
    random = np.random.default_rng(2)
    plan = np.concatenate([random.uniform(0.0, 48.0, (2000, 2)), random.normal(30.0, 4.0, (20_000, 2))])
    sizes, counts = [], np.zeros(len(plan), dtype=int)
    for inside, seen in overlapping_pieces(plan, edge=24.0, margin=4.0, largest=8000):
        counts[inside] += 1
        sizes.append(len(seen))
    assert (counts == 1).all()
    assert max(sizes) <= 8000
    assert list(overlapping_pieces(np.zeros((0, 2)))) == []


def test_classes_are_carried_to_the_full_cloud() -> None:
    known = np.array([[0, 0, 0], [1, 0, 0]], dtype=np.float32)
    points = np.array([[0.4, 0, 0], [0.6, 0, 0], [9, 0, 0]], dtype=np.float32)
    assert nearest_labels(known, np.array([3, 4], dtype=np.int16), points).tolist() == [3, 4, 4]
    assert len(nearest_labels(known, np.array([3, 4], dtype=np.int16), points[:0])) == 0


def test_a_tile_is_labelled_and_scored_on_all_its_points() -> None:
    tile = road_tile(60_000)
    labels = label_tile(tile, Scaling(), by_brightness, CropSettings(voxel=0.3))
    assert labels.shape == (60_000,)
    confusion = Confusion(tuple("abcde"))
    confusion.add(tile.segment, labels)
    assert confusion.counts.sum() == 60_000
    assert confusion.values("iou")[1] > 0.8
    grouped = Confusion(tuple("abcde"))
    grouped.add(road_tile(100).segment, np.full(100, 3, dtype=np.int16))
    assert grouped.counts[:, 3].sum() == 100


def test_a_tiles_core_sees_its_surroundings() -> None:
    tile = road_tile(20_000)
    core = (tile.coord[:, 0] > 20.0) & (tile.coord[:, 0] < 40.0) & (np.abs(tile.coord[:, 1] - 20.0) < 12.0)
    assert (label_tile(tile, Scaling(), by_view, SETTINGS, core) == 1).all()
    alone = label_tile(tile.select(core), Scaling(), by_view, SETTINGS)
    assert (alone == 0).any()


@pytest.fixture
def labelling() -> Labelling:
    """Return one that goes by brightness."""
    return Labelling(by_brightness, SETTINGS, class_scheme("5"), "share")


def others_cloud(path: Path, count: int = 30_000) -> laspy.LasData:
    """Write a cloud with everything that a LAS file may hold, of 130 m, its points in no order; return it."""
    header = laspy.LasHeader(point_format=8, version="1.4")
    header.scales, header.offsets = np.array([0.001, 0.002, 0.0005]), np.array([4e5, 5.6e6, 100.0])
    header.add_extra_dims(
        [
            laspy.ExtraBytesParams("reflectance", "float32"),
            laspy.ExtraBytesParams("deviation", "int16", scales=[0.01], offsets=[5.0]),
            laspy.ExtraBytesParams("normal", "3float64"),
        ]
    )
    header.vlrs.append(laspy.VLR("someone", 7, "note", b"kept"))
    header.system_identifier = "a scanner"
    block = road_block(count, 5, length=130.0)
    las = laspy.LasData(header)
    las.x, las.y, las.z = block.xyz.T
    random = np.random.default_rng(6)
    for name in las.point_format.dimension_names:
        if name in ("X", "Y", "Z"):
            continue
        kind = las[name].dtype
        flags = ("synthetic", "key_point", "withheld", "overlap", "edge_of_flight_line", "scan_direction_flag")
        high = 2 if name in flags else 4 if name in ("return_number", "number_of_returns", "scanner_channel") else 120
        values = random.integers(0, high, count) if kind.kind in "iu" else random.normal(size=las[name].shape)
        las[name] = values
    las.intensity = np.rint(block.intensity * 65535)
    las.red, las.green, las.blue = block.rgb.T
    las.evlrs = laspy.vlrs.vlrlist.VLRList([laspy.VLR("someone", 9, "long note", b"kept as well")])
    las.write(path)
    with path.open("r+b") as file:  # as some write it, though LAS asks for ASCII
        file.seek(58)
        file.write("Büro für Vermessung".encode("latin-1"))
    return laspy.read(path)


def usable(las: laspy.LasData) -> np.ndarray:
    """Return the mask of the points that are neither withheld nor noise."""
    return ~(np.asarray(las.withheld, dtype=bool) | np.isin(np.asarray(las.classification), (7, 18)))


def test_prediction_keeps_everything_and_adds_the_class(tmp_path: Path, labelling: Labelling) -> None:
    before = others_cloud(tmp_path / "in.laz")
    result = predict_file(tmp_path / "in.laz", tmp_path / "out.laz", labelling)
    after = laspy.read(tmp_path / "out.laz")
    names = list(before.point_format.dimension_names)
    assert list(after.point_format.dimension_names) == [*names, PREDICTED]
    for name in before.points.array.dtype.names:
        assert (before.points.array[name] == after.points.array[name]).all(), name
    for name in names:
        np.testing.assert_array_equal(np.asarray(before[name]), np.asarray(after[name]))
    notes = [vlr.record_data_bytes() for vlr in after.vlrs if vlr.user_id == "someone"]
    assert notes == [b"kept"]
    assert [v.record_data_bytes() for v in after.evlrs] == [b"kept as well"]
    texts = ("system_identifier", "generating_software")
    for field in (*texts, "creation_date", "uuid", "point_count", "global_encoding"):
        first, second = getattr(before.header, field), getattr(after.header, field)
        assert getattr(first, "value", first) == getattr(second, "value", second), field
    assert (before.header.offsets == after.header.offsets).all()
    assert (before.header.scales == after.header.scales).all()
    assert (before.header.mins == after.header.mins).all()
    truth = road_block(30_000, 5, length=130.0).class_id
    seen = usable(before)
    assert (np.asarray(after[PREDICTED]) == truth)[seen].mean() > 0.85
    assert result["points"] == 30_000
    assert sum(result["classes"].values()) == seen.sum()
    assert result["points_per_second"] > 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.laz", "out.laz"]


def test_tiles_and_blocks_do_not_show(tmp_path: Path, labelling: Labelling, monkeypatch: pytest.MonkeyPatch) -> None:
    others_cloud(tmp_path / "in.laz", 12_000)
    predict_file(tmp_path / "in.laz", tmp_path / "whole.las", labelling)
    monkeypatch.setattr(prediction, "BLOCK", 1000)
    predict_file(tmp_path / "in.laz", tmp_path / "blocks.las", labelling)
    whole, blocks = (laspy.read(tmp_path / name) for name in ("whole.las", "blocks.las"))
    assert (whole.points.array == blocks.points.array).all()


def test_tiles_of_a_file_see_what_lies_around_them(tmp_path: Path) -> None:
    others_cloud(tmp_path / "in.laz", 40_000)
    scheme = class_scheme("5")
    predict_file(tmp_path / "in.laz", tmp_path / "out.las", Labelling(by_view, SETTINGS, scheme, "share"))
    found = laspy.read(tmp_path / "out.las")
    plan = np.column_stack([found.x, found.y])
    inside = np.all((plan - plan.min(axis=0) > 4.0) & (plan.max(axis=0) - plan > 4.0), axis=1)
    # Tiles of 48 m end within the cloud of 130 m, and no point there may see less than 3 m to any side.
    inside &= usable(found)
    assert inside.sum() > 10_000
    assert (np.asarray(found[PREDICTED])[inside] == scheme.rows[1].id).all()
    assert (np.asarray(found[PREDICTED]) == scheme.rows[0].id).any()


def test_cloud_optimised_files_are_copied_as_plain_ones(tmp_path: Path, labelling: Labelling) -> None:
    las = others_cloud(tmp_path / "in.laz", 2000)
    las.header.vlrs.append(laspy.VLR("copc", 1, "COPC info", bytes(160)))
    las.evlrs.append(laspy.VLR("copc", 1000, "EPT hierarchy", bytes(32)))
    las.header.system_identifier = las.header.generating_software = ""
    las.write(tmp_path / "plain.las")
    predict_file(tmp_path / "plain.las", tmp_path / "out.laz", labelling)
    found = laspy.read(tmp_path / "out.laz")
    assert len(found.points) == 2000
    assert [record.user_id for record in (*found.header.vlrs, *found.evlrs)].count("copc") == 0
    assert {"someone"} <= {record.user_id for record in found.evlrs}


def test_colours_of_eight_bits_are_not_black(tmp_path: Path) -> None:
    seen = []

    def look(batch: Item) -> torch.Tensor:
        seen.append(batch["color"].amax(dim=0))
        return by_brightness(batch)

    for name, factor in (("sixteen", 257), ("eight", 1)):
        las = others_cloud(tmp_path / f"{name}.las", 2000)
        random = np.random.default_rng(1)
        las.red, las.green, las.blue = factor * random.integers(0, 256, (3, 2000))
        las.header.system_identifier = las.header.generating_software = ""
        las.write(tmp_path / f"{name}.las")
        seen.clear()
        predict_file(
            tmp_path / f"{name}.las",
            tmp_path / f"{name}-out.las",
            Labelling(look, SETTINGS, class_scheme("5"), "share"),
        )
        assert float(torch.stack(seen).max()) > 0.9, name


def test_a_second_prediction_replaces_the_first_and_codes_follow(tmp_path: Path, labelling: Labelling) -> None:
    write_cloud(tmp_path / "in.laz", road_block(5000, 5))
    predict_file(tmp_path / "in.laz", tmp_path / "once.laz", labelling, classification=True)
    predict_file(tmp_path / "once.laz", tmp_path / "twice.laz", labelling)
    once, twice = laspy.read(tmp_path / "once.laz"), laspy.read(tmp_path / "twice.laz")
    assert (once.points.array == twice.points.array).all()
    codes = class_scheme("5").las_codes()
    assert (np.asarray(once.classification) == codes[np.asarray(once[PREDICTED])]).all()
    assert (np.asarray(once["class_id"]) == road_block(5000, 5).class_id).all()  # the truth stays


def test_withheld_points_and_noise_are_seen_by_no_network_and_stay_as_they_are(
    tmp_path: Path, labelling: Labelling, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same classes as without them, though they lie among the others and far around them, at any size of block."""
    las = others_cloud(tmp_path / "in.las", 6_000)
    las.header.system_identifier = las.header.generating_software = ""
    las.classification[::10], las.withheld[::7] = 7, 1
    las.z[~usable(las)] -= 40.0
    las.x[~usable(las)] -= 500.0
    las.write(tmp_path / "in.las")
    clean = las[usable(las)]
    clean.write(tmp_path / "clean.las")
    monkeypatch.setattr(prediction, "BLOCK", 500)
    with collected_remarks() as remarks:
        told = predict_file(tmp_path / "in.las", tmp_path / "out.las", labelling, classification=True)
    predict_file(tmp_path / "clean.las", tmp_path / "clean-out.las", labelling, classification=True)
    found, expected = laspy.read(tmp_path / "out.las"), laspy.read(tmp_path / "clean-out.las")
    seen = usable(las)
    assert 500 < seen.sum() < 5_500
    assert (found.points.array[seen] == expected.points.array).all()
    assert set(np.asarray(found[PREDICTED])[~seen].tolist()) == {UNLABELLED}
    assert (np.asarray(found.classification)[~seen] == np.asarray(las.classification)[~seen]).all()
    assert (told["points"], told["left_out"]) == (6_000, (~seen).sum())
    assert [("withheld" in text, "noise" in text) for text in remarks] == [(True, False), (False, True)]
    told["output"] = "out.las"
    assert f"{(~seen).sum():,} of them withheld or noise" in labelled(told)
    las.withheld[:] = 1
    las.write(tmp_path / "all.las")
    with pytest.raises(InputError, match="no points that can be labelled: all are withheld or noise"):
        predict_file(tmp_path / "all.las", tmp_path / "none.las", labelling)
    assert not (tmp_path / "none.las").exists()


def test_bad_input_is_told_and_leaves_nothing(tmp_path: Path, labelling: Labelling) -> None:
    cloud = write_cloud(tmp_path / "in.laz", road_block(3000, 5))
    with pytest.raises(MissingFileError):
        predict_file(tmp_path / "no.laz", tmp_path / "out.laz", labelling)
    with pytest.raises(InputError, match="must end in"):
        predict_file(cloud, tmp_path / "out.ply", labelling)
    (tmp_path / "there.laz").write_bytes(b"mine")
    with pytest.raises(OutputError, match="overwrite"):
        predict_file(cloud, tmp_path / "there.laz", labelling)
    (tmp_path / "cut.laz").write_bytes(cloud.read_bytes()[:-20_000])
    with pytest.raises(InputError, match=r"truncated|damaged"):
        predict_file(tmp_path / "cut.laz", tmp_path / "out.laz", labelling)
    header = laspy.LasHeader(point_format=3, version="1.2")
    old = laspy.LasData(header)
    old.x, old.y, old.z = np.zeros((3, 5))
    old.write(tmp_path / "old.las")
    started: list[Item] = []

    def noted(batch: Item) -> torch.Tensor:
        started.append(batch)
        return by_brightness(batch)

    beforehand = Labelling(noted, SETTINGS, class_scheme("5"), "share")
    with pytest.raises(InputError, match="point format"):
        predict_file(tmp_path / "old.las", tmp_path / "out.las", beforehand, classification=True)
    assert not started, "it is told before the work begins"
    predict_file(tmp_path / "old.las", tmp_path / "old-out.las", labelling)

    def broken(batch: Item) -> torch.Tensor:
        raise RuntimeError("no")

    with pytest.raises(RuntimeError):
        predict_file(cloud, tmp_path / "out.laz", Labelling(broken, SETTINGS, class_scheme("5"), "share"))
    found = sorted(path.name for path in tmp_path.iterdir())
    assert found == ["cut.laz", "in.laz", "old-out.las", "old.las", "there.laz"]


def by_side(batch: Item) -> torch.Tensor:
    """Score class 1 where a point lies east of its piece's middle, else class 0."""
    east = batch["coord"][:, 0] > 0.0
    return torch.stack([~east, east], dim=1).float() * 4.0


def test_votes_are_the_mean_of_turned_views() -> None:
    """Scores that go by direction even out; those that every view gives stay."""
    tile = road_tile(6_000)
    votes = CropSettings(voxel=0.3, votes=16)
    labels = label_tile(tile, Scaling(), by_brightness, votes)
    assert (labels == label_tile(tile, Scaling(), by_brightness, CropSettings(voxel=0.3))).all()
    small = tile.select(np.unique(np.floor(tile.coord / 1.0), axis=0, return_index=True)[1])
    own = small.coord[:, 0] < 30.0
    told = {}
    for count in (1, 16):
        settings = CropSettings(voxel=0.3, votes=count)
        pairs = list(piece_scores(small, Scaling(), by_side, settings, own))
        inside = np.concatenate([place for place, _ in pairs])
        assert sorted(inside) == np.flatnonzero(own).tolist()
        told[count] = torch.cat([scores for _, scores in pairs]).softmax(dim=1)[:, 1]
    assert told[1].std() > 0.45
    assert told[16].std() < 0.2
    assert abs(told[16].mean() - 0.5) < 0.1
