"""Make a data set of two roads, load it by PyTorch, and train a network of two layers that looks at single points."""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import torch
from torch.utils.data import DataLoader

from ml.data.crops import CropDataset, CropSettings, Draw, Seeds, collate
from ml.data.sources import Source, read_tiles
from ml.data.tiles import scalings
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.errors import SynthRoadsError

RECIPE = Path(__file__).with_name("two-roads.yaml")
SCHEME = class_scheme("5")


def batches(folder: Path, split: str) -> DataLoader:
    """Return a loader of packed batches of crops; Blender never runs in it."""
    tiles = list(read_tiles(Source(path=str(folder), split=split), SCHEME, voxel=0.3))
    plan = [Draw(tile, number) for tile in range(len(tiles)) for number in range(2)]
    seeds = Seeds(tiles, len(SCHEME.rows), balanced=False)
    crops = CropDataset(tiles, scalings(tiles, "robust"), CropSettings(points=2000), plan, seeds, seed=1, epoch=0)
    return DataLoader(crops, batch_size=2, collate_fn=collate)


def main(output: Path, epochs: int = 10) -> None:
    """Make the set, train on its first road, and print the share of right points on its second."""
    folder = output / "roads"
    subprocess.run([sys.executable, "-m", "headless.dataset", str(RECIPE), "--output", str(folder)], check=True)
    torch.manual_seed(1)
    train, test = list(batches(folder, "train")), list(batches(folder, "test"))
    print({name: tuple(tensor.shape) for name, tensor in train[0].items()})
    first, last = torch.nn.Linear(train[0]["feat"].shape[1], 32), torch.nn.Linear(32, len(SCHEME.rows))
    network = torch.nn.Sequential(first, torch.nn.ReLU(), last)
    optimiser = torch.optim.Adam(network.parameters(), lr=0.02)
    for _ in range(epochs):
        for batch in train:
            loss = torch.nn.functional.cross_entropy(network(batch["feat"]), batch["segment"], ignore_index=-1)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
    with torch.no_grad():
        right = torch.cat([network(batch["feat"]).argmax(1) == batch["segment"] for batch in test])
    print(f"loss {loss.item():.3f} in training; {right.float().mean():.1%} of the unseen road's points are right")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path, help="folder for the files")
    parser.add_argument("epochs", type=int, nargs="?", default=10, help="of the training (10)")
    try:
        main(**vars(parser.parse_args()))
    except (SynthRoadsError, OSError, subprocess.CalledProcessError) as error:
        parser.exit(2, f"error: {error}\n")
