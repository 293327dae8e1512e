"""Batches for training and for the norms' statistics: tiles read, crops drawn and prepared in workers."""

import math
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import torch

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.random_streams import stream

from ..data.classes import class_names
from ..data.crops import CropDataset, Draw, Item, Seeds, collate
from ..data.exchange import ExchangedCrops
from ..data.road_offsets import with_offsets
from ..data.scene_stream import EpochScenes, SceneStream
from ..data.sources import Source, read_tiles
from ..data.tiles import CloudTile, scalings
from ..data.workers import load_batches
from .network import gpu_prepares, overlay_clouds
from .recipes import SegmentationConfiguration, map_intensities, plan

SMALLEST_SHARE = 0.25
"""Of a crop's points: tiles with fewer are left out of training, unless all have. Chosen: a smaller tile shows too
little of a scene."""


def read_domains(configuration: SegmentationConfiguration) -> dict[str, list[CloudTile]]:
    """Read the thinned training tiles by domain (synthetic, real); intensities are mapped for `mixed_mapped`.

    A grid of tiles cuts slivers off at a road's ends. As every tile has as many crops, they would take up half of a
    training on short roads. Where there is a stream, whose scenes belong to the synthetic ones, all is as it was read:
    see `StreamedCropBatches`.

    Raises:
        InputError: there are none, or they don't fit the configuration.
    """
    domains: dict[str, list[CloudTile]] = {}
    for domain, sources in configuration.needed_sources().items():
        domains[domain] = list(thin_tiles(sources, configuration, domain, offsets=_needs_offsets(configuration)))
    return domains if configuration.data.stream else prepare_domains(domains, configuration)


def prepare_domains(
    domains: Mapping[str, Sequence[CloudTile]], configuration: SegmentationConfiguration
) -> dict[str, list[CloudTile]]:
    """Return domains without slivers, synthetic intensities mapped for `mixed_mapped`; see `read_domains`."""
    prepared = {domain: drop_slivers(tiles, configuration) for domain, tiles in domains.items()}
    if configuration.set_up == "mixed_mapped" and "real" in prepared and "synthetic" in prepared:
        prepared["synthetic"] = map_intensities(prepared["synthetic"], prepared["real"])
    return prepared


def drop_slivers(tiles: Sequence[CloudTile], configuration: SegmentationConfiguration) -> list[CloudTile]:
    """Return the tiles with at least `SMALLEST_SHARE` of a crop's points; all with any point if there are none."""
    smallest_size = SMALLEST_SHARE * configuration.crop_points
    return [tile for tile in tiles if len(tile) >= smallest_size] or [tile for tile in tiles if len(tile)]


def thin_tiles(
    sources: Sequence[Source],
    configuration: SegmentationConfiguration,
    title: str,
    *,
    labels: bool = True,
    offsets: bool = False,
) -> Iterator[CloudTile]:
    """Yield the sources' tiles thinned to one point per training voxel, scenes renamed to ``TITLE/PLACE/SCENE``.

    Scenes of two sources may share a name: the new names keep the scaling of their intensities separate.

    Args:
        sources, configuration: sources of the tiles, and configuration of the training.
        title: title of the domain.
        labels: whether labels are read; else all are `IGNORED`.
        offsets: whether points have their offsets from the axes of data sets' roads.
    """
    for source_number, source in enumerate(sources):
        tiles = read_tiles(source, configuration.scheme(), configuration.voxel, labels=labels)
        for tile in with_offsets(Path(source.path), tiles) if offsets else tiles:
            yield replace(tile, scene=f"{title}/{source_number}/{tile.scene}")


class CropBatches:
    """Training batches of crops: called with an epoch and a slice it yields them, determined by seed and epoch alone.

    Args:
        configuration: of the training.
        domains: tiles by domain; the synthetic ones first where there are two.
        device: device of the training; on a GPU the network may prepare batches itself.
    """

    def __init__(
        self,
        configuration: SegmentationConfiguration,
        domains: Iterable[Sequence[CloudTile]],
        device: torch.device,
    ) -> None:
        self.configuration = configuration
        self.device = device
        self.domains = list(domains)
        self.tiles = [tile for tiles in self.domains for tile in tiles]
        self.scaling = scalings(self.tiles, configuration.intensity)
        self.seeds = self._seeds()

    def __len__(self) -> int:
        configuration = self.configuration
        return math.ceil(
            (configuration.crops_per_epoch or configuration.crops_per_tile * len(self.tiles)) / configuration.batch
        )

    def __call__(self, epoch: int, share: slice = slice(None)) -> Iterator[Item]:
        """Yield the batches of an epoch whose numbers, from 0, `share` selects."""
        configuration, sizes = self.configuration, [len(tiles) for tiles in self.domains]
        draws = plan(
            sizes,
            configuration.crops_per_tile,
            configuration.synthetic_share,
            configuration.seed,
            epoch,
            configuration.crops_per_epoch,
        )
        crops = self._crops(self.tiles, draws, self.seeds[0], epoch)
        yield from _load_crops(crops, configuration, epoch, configuration.adaptation.mix3d, share, self.device)

    def _seeds(self) -> list[Seeds]:
        """Return the sampler of crop centres in all tiles.

        Where a share is stated, a crop stays in the domain that it was planned in, whatever class is looked for.
        """
        configuration = self.configuration
        groups = [len(tiles) for tiles in self.domains] if configuration.synthetic_share is not None else ()
        return [Seeds(self.tiles, len(class_names(configuration.scheme())), configuration.balanced, groups)]

    def _crops(self, tiles: Sequence[CloudTile], draws: Sequence[Draw], seeds: Seeds, epoch: int) -> CropDataset:
        """Return the data set of an epoch's planned crops of some tiles."""
        configuration = self.configuration
        settings, scaling = configuration.crop_settings(), self.scaling
        return CropDataset(
            tiles, scaling, settings, draws, seeds, effects=configuration.effects, seed=configuration.seed, epoch=epoch
        )


class ExchangedBatches(CropBatches):
    """Training batches of pairs of crops, synthetic and target ones, with parts of each other in them.

    Args: see `CropBatches`; the domains are synthetic tiles and those of the target with believed labels.
    """

    def _seeds(self) -> list[Seeds]:
        """Return a sampler of crop centres per domain; guessed labels are too few to balance classes by."""
        classes, (synthetic, target) = len(class_names(self.configuration.scheme())), self.domains
        return [Seeds(synthetic, classes, self.configuration.balanced), Seeds(target, classes, balanced=False)]

    def __len__(self) -> int:
        return math.ceil(self._pairs() / self._pairs_per_batch())

    def __call__(self, epoch: int, share: slice = slice(None)) -> Iterator[Item]:
        """Yield the batches of an epoch whose numbers, from 0, `share` selects."""
        configuration = self.configuration
        synthetic, target = (
            self._crops(tiles, self._draws(len(tiles), domain_number, epoch), seeds, epoch)
            for domain_number, (tiles, seeds) in enumerate(zip(self.domains, self.seeds, strict=True))
        )
        pairs = ExchangedCrops(synthetic, target, configuration.seed, epoch)
        yield from _load_crops(pairs, configuration, epoch, 0.0, share, self.device, self._pairs_per_batch())

    def _pairs(self) -> int:
        """Return the pairs of an epoch: as many as there are crops of synthetic tiles."""
        configuration = self.configuration
        return configuration.crops_per_epoch or configuration.crops_per_tile * len(self.domains[0])

    def _pairs_per_batch(self) -> int:
        """Return the pairs of a batch: half of its crops, at least one."""
        return max(self.configuration.batch // 2, 1)

    def _draws(self, tiles: int, domain_number: int, epoch: int) -> list[Draw]:
        """Return one draw of a domain's tiles for each pair, all tiles as often, in random order."""
        order = stream(self.configuration.seed, "pairs", domain_number, epoch).permutation(self._pairs())
        # Crops of the two domains have numbers, and with them random streams, of their own.
        return [Draw(int(number % tiles), int(number // tiles) * 2 + domain_number) for number in order]


class StreamedCropBatches:
    """Training batches of crops like those of `CropBatches`, whose synthetic tiles are also those of a stream's scenes.

    Args:
        configuration: of the training.
        domains: the tiles of each as they were read, the synthetic ones first; the stream's come behind these.
        stream: of the scenes.
        device: see `CropBatches`.

    Attributes:
        epoch: epoch that was begun last; None before the first.
        tiles: tiles of that epoch.
    """

    def __init__(
        self,
        configuration: SegmentationConfiguration,
        domains: Mapping[str, Sequence[CloudTile]],
        stream: SceneStream,
        device: torch.device,
    ) -> None:
        self.configuration, self._fixed, self.device = configuration, dict(domains), device
        self._scenes = EpochScenes(stream, partial(streamed_tiles, configuration))
        self.tiles: list[CloudTile] = []
        self.epoch: int | None = None

    def __len__(self) -> int:
        configuration = self.configuration
        assert configuration.crops_per_epoch is not None, "the configuration has seen to it"
        return math.ceil(configuration.crops_per_epoch / configuration.batch)

    def domains(self, epoch: int) -> dict[str, list[CloudTile]]:
        """Return an epoch's tiles by domain, when all its scenes are there.

        Raises:
            InputError: a scene can't be made, or all of them together have no points.
        """
        tiles = [*self._fixed["synthetic"], *self._scenes(epoch)]
        if not any(map(len, tiles)):
            raise InputError("data.stream", epoch, "at least one scene of an epoch must have a tile with points")
        return prepare_domains(self._fixed | {"synthetic": tiles}, self.configuration)

    def __call__(self, epoch: int, share: slice = slice(None)) -> Iterator[Item]:
        """Yield the batches of an epoch whose numbers, from 0, `share` selects."""
        batches = CropBatches(self.configuration, self.domains(epoch).values(), self.device)
        self.epoch, self.tiles = epoch, batches.tiles
        yield from batches(epoch, share)


def streamed_tiles(configuration: SegmentationConfiguration, number: int, folder: Path) -> list[CloudTile]:
    """Return the thinned tiles of a stream's scene; an empty list if it has none."""
    if not any(folder.glob("pointcept/*/*/*/coord.npy")):
        return []
    sources, needs_offsets = [Source(path=str(folder))], _needs_offsets(configuration)
    return list(thin_tiles(sources, configuration, f"stream/{number}", offsets=needs_offsets))


def _needs_offsets(configuration: SegmentationConfiguration) -> bool:
    """Return whether an effect needs the points' offsets from their roads' axes."""
    effects = configuration.effects
    return bool(effects.strip.probability or effects.stripes or effects.verge_band)


def _load_crops(
    dataset: CropDataset | ExchangedCrops,
    configuration: SegmentationConfiguration,
    epoch: int,
    mix3d: float,
    share: slice,
    device: torch.device,
    size: int | None = None,
) -> Iterator[Item]:
    """Yield the batches of an epoch that a share selects, prepared by the configuration's workers.

    Args:
        dataset: crops or pairs of crops of the epoch.
        configuration: of the training.
        epoch: number of the epoch.
        mix3d: share of batches that are overlaid (Mix3D).
        share: slice of the batches' numbers.
        device: device of the training.
        size: elements of a batch; None for the configuration's.
    """
    numbers, size = range(len(dataset)), size or configuration.batch
    return load_batches(
        dataset,
        [numbers[start : start + size] for start in numbers[::size][share]],
        Collate(configuration, epoch, mix3d, gpu_prepares(configuration, device)),
        configuration.workers,
        pin_memory=device.type == "cuda",
    )


@dataclass(frozen=True)
class Collate:
    """Collate function run in the workers: batches items, at random overlays them (Mix3D), and prepares them.

    Attributes:
        configuration, epoch: of the training.
        mix3d: share of batches that are overlaid.
        left_to_gpu: whether batches are left to be prepared by the network's device.
    """

    configuration: SegmentationConfiguration
    epoch: int
    mix3d: float
    left_to_gpu: bool

    def __call__(self, samples: Sequence[Item] | Sequence[list[Item]]) -> Item:
        """Return the batch of items or of pairs, perhaps overlaid, prepared unless the GPU does that."""
        items = [item for sample in samples for item in (sample if isinstance(sample, list) else [sample])]
        batch = collate(items)
        if self.mix3d and self._chance(items[0]) < self.mix3d:
            batch = overlay_clouds(batch)
        return batch if self.left_to_gpu else self.configuration.network.prepare(batch)

    def _chance(self, item: Item) -> float:
        """Return a random number from 0 to 1 seeded by the first item's points: workers don't know batch numbers."""
        content = zlib.crc32(item["coord"].numpy().tobytes())
        return float(stream(self.configuration.seed, "mix3d", self.epoch, content).random())


def adaptation_batches(
    tiles: list[CloudTile], configuration: SegmentationConfiguration, device: torch.device
) -> Iterator[Item]:
    """Yield batches of random unaugmented crops of a test's tiles, for AdaBN; none without tiles."""
    if not tiles:
        return
    # By their points: a sliver says as much of the scene as it holds of it.
    shares = np.array([len(tile) for tile in tiles]) / sum(map(len, tiles))
    random = stream(configuration.seed, "adaptation")
    tile_indices = random.choice(len(tiles), configuration.adaptation.adabn_crops, p=shares)
    dataset = CropDataset(
        tiles,
        scalings(tiles, configuration.intensity),
        configuration.crop_settings(),
        [Draw(int(tile), number) for number, tile in enumerate(tile_indices)],
        Seeds(tiles, 0, balanced=False),
        seed=configuration.seed,
    )
    yield from _load_crops(dataset, configuration, 0, 0.0, slice(None), device)
