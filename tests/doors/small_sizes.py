"""How each line that users are shown is run in a small size: one row for each, in the order in which they are run.

A line of the pages without a row, and a row without a line, are failures. What is run is what stands in the page, with
some words replaced (`instead`) and some behind it (`more`), so that it takes seconds; the rest of the line, its options
and names, is the page's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from tests.doors.documented import ROOT

EXTRAS = ("ml", "twin", "e57", "maps", "cluster", "onnx", "changes")
"""Extras of pyproject.toml that users add to what `make demo` installs."""

_MAKE = "the doors are behind it: it makes the environment that everything here is run in"
_PIP = "it makes an environment; those of the extras are made by the session that runs this"
_SLURM = "it needs Slurm: tests/cluster runs the script on one"


@dataclass(frozen=True)
class Small:
    """How one documented line is run in a small size.

    Attributes:
        text: the line or snippet as it stands in the page; of a snippet or file its first line.
        more: what is put behind a command, or in front of a snippet.
        instead: words of the page -> what is put in their place; each must be there.
        inputs: files of the reader's own that the page takes for granted, made before it: names of `run.INPUTS`.
        needs: extras without which the line is refused.
        code: exit code of a command that does its work: 3 for a result that is said to be doubtful.
        seconds: processor time after which it counts as too slow.
        both: whether `make test` runs it with both of Blender's releases, as it shows what differs between them;
            the others are run with one, and `make doors` runs all with both.
        reason: why the line isn't run here; empty if it is.
    """

    text: str
    more: str = ""
    instead: Mapping[str, str] = field(default_factory=dict)
    inputs: tuple[str, ...] = ()
    needs: frozenset[str] = frozenset()
    code: int = 0
    seconds: float = 90.0
    both: bool = False
    reason: str = ""

    def command(self, text: str) -> str:
        """Return what is run for a documented command or snippet.

        Raises:
            ValueError: a word that is to be replaced isn't in it.
        """
        for old, new in self.instead.items():
            if old not in text:
                raise ValueError(f"{text.splitlines()[0]}: {old} is to be replaced and isn't there")
            text = text.replace(old, new)
        if self.more:
            return f"{self.more}\n{text}" if "\n" in text else f"{text} {self.more}"
        return text


_ROAD = "--set road.length=60 --set road.half_width=20 --set scan.platform.speed=30"
_SMALL_ROAD = {'"fidelity=draft"': '"fidelity=draft", "road.length=60", "road.half_width=20", "scan.platform.speed=30"'}
_DRAFT = f"--fidelity draft {_ROAD}"
_CLOUD = """--set 'outputs=["parameters", "cloud"]'"""
_PARAMETERS = """--set 'outputs=["parameters"]'"""
_FAST = "--fidelity draft --set scan.platform.speed=30"
_SCENES = f"--set fidelity=draft {_ROAD} --set road.half_width=25"
_GANTRIES = "--set road.furniture.gantry_spacing=30"
_TRAINING = "--set schedule.epochs=1 --set crops_per_tile=1 --set crop_points=1000 --set voxel=0.5 --set batch=2"
_NETWORK = '--set \'network={"preset": "S", "width": 8, "radius": 1.0, "neighbours": 8}\' --set threads=1'
_TINY = f"{_TRAINING} {_NETWORK}"
_EXAMPLES = {"python examples/": f"python {ROOT / 'examples'}/"}
_ML, _TWIN, _E57, _CLUSTER = (frozenset({name}) for name in ("ml", "twin", "e57", "cluster"))

ROWS = (
    # README.md
    Small("make demo", reason=_MAKE),
    Small("make test", reason="it runs the tests, of which this is one"),
    Small(". .venv/bin/activate", reason="the environment's own commands are called by their path"),
    Small("synthroads generate --scenario rq31-600m --output out/mine --seed 7 --fidelity draft", _ROAD, both=True),
    Small(
        "synthroads generate --output out/wide --set road.cross_section=RQ43.5 --set road.length=1000",
        f"{_DRAFT} --set road.half_width=25 {_CLOUD}",
        {"--set road.length=1000": ""},
    ),
    Small(  # whose length is the axis's
        "synthroads generate --output out/real --axis axis.csv",
        f"{_DRAFT} {_CLOUD}".replace("--set road.length=60 ", ""),
        {},
        ("axis.csv",),
    ),
    Small("synthroads road road.xodr --output out/road-of-mine", inputs=("road.xodr",)),
    Small("synthroads road map.osm --output out/road-of-a-map", inputs=("map.osm",)),
    Small("synthroads generate --output out/mms --scenario mobile-mapping-300m", f"{_DRAFT} {_CLOUD}"),
    Small(
        "synthroads scan scene.glb --device velodyne-hdl-64e --height 2 --output out/own",
        "--fidelity draft --speed 30",
        {},
        ("scene.glb",),
        both=True,
    ),
    # Structures and interchanges need a road of their own length.
    Small(
        "synthroads generate --output out/half-clover --scenario half-clover-1500m", f"{_FAST} {_CLOUD}", seconds=240.0
    ),
    Small("synthroads generate --output out/bridge --scenario bridge-300m", f"{_FAST} {_CLOUD}", seconds=120.0),
    Small("synthroads generate --output out/tunnel --scenario tunnel-300m", f"{_FAST} {_CLOUD}", seconds=120.0),
    Small(
        "synthroads generate --output out/interchange --scenario interchange-1300m",
        f"{_FAST} {_PARAMETERS}",
        seconds=120.0,
    ),
    Small(
        "synthroads generate --output out/pictures --scenario mobile-mapping-300m --set scan.cameras.rig=ladybug5-plus",
        f"{_DRAFT} {_CLOUD} --set scan.cameras.spacing=40 --set scan.cameras.megapixels=0.02",
        seconds=120.0,
    ),
    Small(
        "synthroads generate --output out/traffic --scenario mobile-mapping-300m --device velodyne-vlp-32c "
        "--sweeps kitti,openlabel",
        f"{_DRAFT} {_CLOUD}",
        seconds=120.0,
    ),
    Small(
        """synthroads generate --output out/scene --set 'outputs=["scene", "parameters"]' """
        """--set 'scene_formats=["usd", "gltf", "3dtiles"]'""",
        _DRAFT,
    ),
    Small("synthroads cloud info out/mine/cloud.laz"),
    Small("python examples/cloud_to_numpy/cloud_to_numpy.py out/numpy out/mine/cloud.laz", "", _EXAMPLES),
    Small("synthroads parameters --seed 7 --count 100", "", {"100": "3"}),
    Small("synthroads check out/mine/parameters.json"),
    Small("synthroads twin out/mine/parameters.json --output out/twin", needs=_TWIN),
    Small(
        "synthroads calibrate --real scan.laz --material asphalt=road --save mine.json", "--formulas", {}, ("scan.laz",)
    ),
    Small("synthroads compare out/mine/cloud.laz real.yaml --output out/compared", inputs=("real.yaml",)),
    Small(
        "synthroads dataset reference --output out/reference --jobs 2",
        f"{_SCENES} {_GANTRIES}",
        {"reference --output": "reference.yaml --output"},
        ("reference.yaml",),
        seconds=180.0,
    ),
    Small("synthroads epochs --scenario rq31-600m --output out/pair", f"{_ROAD} {_CLOUD}", seconds=180.0),
    Small("synthroads train segmentation --output out/run", f"{_TINY} --set data.validation=[]", needs=_ML),
    Small(
        "synthroads dataset standin --output out/standin",
        f"{_SCENES} {_GANTRIES} --set scan.pulse_rate_khz=50",
        {"standin --output": "standin.yaml --output"},
        ("standin.yaml",),
        seconds=180.0,
    ),
    Small(
        "synthroads experiment gantries --data real=out/standin --data synthetic=out/reference --output out/gantries",
        f"{_TINY} --seeds 1 --set fine_tuning.epochs=1",
        needs=_ML,
    ),
    Small("synthroads predict scan.laz", inputs=("scan.laz",), needs=_ML),
    Small("synthroads centerline scan.laz", inputs=("scan.laz",)),
    Small("synthroads reconstruct scan.laz --output out/road", inputs=("scan.laz",)),
    Small("synthroads gallery --output out/gallery", "--only materials-roughness --width 64 --samples 1", both=True),
    Small("synthroads generate --tolerance height=5mm,intensity=5% --output out/exact", _ROAD),
    Small("synthroads tradeoff --output out/tradeoff", "--knobs caster --scenario small.json", {}, ("small.json",)),
    Small("synthroads benchmark --output out/benchmark", "--quick --cores 1 --parts demo", seconds=120.0),
    Small("synthroads list devices"),
    Small("pip install -e '.[ml]'", reason=_PIP),
    Small("pip install -e '.[twin]'", reason=_PIP),
    Small(
        "from pathlib import Path",
        instead=_SMALL_ROAD,
    ),
    # docs/start.md
    Small("pip install -e '.[e57]'", reason=_PIP),
    Small("pip install -e '.[maps]'", reason=_PIP),
    Small("synthroads --help"),
    Small("python -m venv .venv", reason=_PIP),
    Small("pip install '.[blender,ml]'", reason=_PIP),
    Small("pip install torch==2.13.0 --index-url https://download.pytorch.org/whl/cpu", reason=_PIP),
    Small("PIP_EXTRA_INDEX_URL=https://download.pytorch.org/whl/cpu make test", reason="it runs the tests"),
    Small("nox -s tests-3.11 -- tests/road/test_alignment.py", reason="it runs tests, which the tests do themselves"),
    Small("make extension", reason="tests/packaging/test_extension.py builds the extension and installs it"),
    # docs/tutorials/data-engineer.md
    Small(
        "synthroads generate --output out/first --fidelity draft --seed 7 --set road.length=120 "
        "--set road.half_width=30",
        _ROAD,
        {"--set road.length=120 --set road.half_width=30": ""},
    ),
    Small(
        "blender -b -P headless/generate.py -- --output out/first --fidelity draft --seed 7 --set road.length=120 "
        "--set road.half_width=30",
        reason="it needs Blender itself, with the extension",
    ),
    Small("synthroads cloud info out/first/cloud.laz"),
    Small("synthroads check out/first/parameters.json"),
    Small("synthroads dataset two-scanners.yaml --output out/two-scanners --jobs 2", _SCENES, seconds=60.0, both=True),
    Small("synthroads dataset two-scanners.yaml --output out/two-scanners --verify", _SCENES),
    Small(
        "synthroads twin out/two-scanners/scenes/flown-01/parameters.json --output out/flown-twin "
        "--twin cityjson,opendrive,geojson"
    ),
    Small(
        "synthroads dataset two-scanners.yaml --output /shared/two-scanners --scheduler tcp://HOST:8786",
        f"{_SCENES} --splits test",
        {"/shared/": "out/shared-"},
        needs=_CLUSTER,
        seconds=180.0,
    ),
    # docs/tutorials/modeller.md
    Small("synthroads check road.json", inputs=("road.json",)),
    Small("synthroads twin road.json --output out/road-twin --twin cityjson,opendrive", inputs=("road.json",)),
    Small(
        "import bpy",
        "import synthroads_addon; synthroads_addon.register()",
        {"length = 300": "length = 60", "/tmp/my_road": "out/my_road"},
        both=True,
    ),
    # docs/tutorials/researcher.md
    Small(
        "synthroads dataset small-roads --output out/small-roads",
        _SCENES,
        {"small-roads --output": "small-roads.yaml --output"},
        ("small-roads.yaml",),
        seconds=180.0,
    ),
    Small("synthroads train segmentation-small --output out/segmentation", _TINY, needs=_ML),
    Small(
        "synthroads train segmentation-small --output out/longer --set schedule.epochs=30 --set seed=2",
        _TINY,
        {"=30": "=2"},
        needs=_ML,
    ),
    Small(
        "synthroads train segmentation-small --output out/of-two "
        """--set 'data.synthetic=[{"path": "out/two-scanners", "split": "train"}]' """
        """--set 'data.tests={"unseen road": [{"path": "out/two-scanners", "split": "test"}]}'""",
        _TINY,
        needs=_ML,
    ),
    Small("synthroads evaluate out/segmentation out/small-roads --split test --output out/scores", needs=_ML),
    Small("synthroads predict out/segmentation out/first/cloud.laz --output out/labelled.laz", needs=_ML),
    Small("from torch.utils.data import DataLoader", needs=_ML),
    # docs/guide
    Small("python examples/own_device/own_device.py out/own-device", "", _EXAMPLES),
    Small("python examples/own_scene/own_scene.py out/own-scene", "", _EXAMPLES, both=True),
    Small("python examples/torch_dataset/torch_dataset.py out/torch", "1", _EXAMPLES, needs=_ML),
    Small("python examples/scan_to_twin/scan_to_twin.py out/scan-to-twin", "scan.laz", _EXAMPLES, ("scan.laz",)),
    Small("python docs/slurm_cluster.py reference /shared/reference --jobs 20 --queue batch", reason=_SLURM),
    Small("python docs/slurm_cluster.py reference /shared/reference --print-script", reason=_SLURM),
    # docs/reference/python.md
    Small("from synthroads_addon import Job, SceneScan, generate, scan_scene, scan_to_arrays"),
    Small("# The points of a road that is sampled and scanned", instead=_SMALL_ROAD),
    Small("# The points of a scene of one's own", inputs=("scene.glb",)),
    Small(
        "# A data set",
        "",
        {'"reference"': '"one-scene.yaml"', **_SMALL_ROAD},
        ("one-scene.yaml",),
    ),
    Small("# The geometric-semantic models of a road"),
    Small("# How surely a cloud is told from real ones", inputs=("real.yaml",)),
    Small("# The points of a cloud labelled by the shipped model that suits it", inputs=("scan.laz",), needs=_ML),
)
