"""One seed is one road on every machine and Python: these bytes were made on Python 3.11 and 3.13 alike.

Python's own sum() of floats differs between releases (compensated since 3.12); `math.fsum` doesn't. Whoever changes how
roads are drawn puts in the new checksum, after having seen that both Pythons give it.
"""

from __future__ import annotations

import hashlib

from synthroads_addon.base.schema import canonical_json
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.scenario import load_scenario

CHECKSUM = "c32b7bc72bbfd855988d456ef5d2cc5d492530e43f772b92cdc3eb8bb3a818d8"
EVERYTHING = ["exits=1", "entries=1", "emergency_bays=1"]


def test_roads_have_the_same_bytes_on_every_python() -> None:
    digest = hashlib.sha256()
    for design_class, section in (("EKA1A", "RQ36"), ("EKA3", "RQ31.5"), ("EKA2", "RQ28")):
        changes = [f"road.design_class={design_class}", f"road.cross_section={section}", "road.length=2000"]
        changes += [f"road.turnouts.{change}" for change in EVERYTHING] + ["road.lane_changes.share=1"]
        scenario = load_scenario("every-class-1500m", changes)
        for seed in range(8):
            objects = sample_road(scenario.road, seed, "").to_dict()["objects"]
            digest.update(canonical_json(objects).encode())
    assert digest.hexdigest() == CHECKSUM
