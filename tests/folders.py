"""Which folders of tests need Blender, which have a process of their own, and which files take longest."""

from __future__ import annotations

BLENDER_TESTS = ("blender", "jobs", "ui")

LONG_FILES = (
    *("blender/model/test_road_variants.py", "jobs/test_dataset.py", "blender/cameras/test_cameras.py"),
    *("jobs/measure/test_tradeoff.py", "jobs/test_scan_scene.py", "jobs/test_generate.py"),
    *("jobs/scan/test_by_section.py", "blender/model/test_every_class.py", "jobs/choose/test_search.py"),
    *("blender/views/test_gallery.py", "ui/work/test_build.py", "ui/work/test_scan.py"),
    *("ui/work/test_rendered_scan.py", "blender/model/test_build.py", "blender/things/test_vegetation.py"),
    *("fitting/test_fit.py", "twin/ifc/test_ifc.py", "packaging/test_extension.py", "twin/cityjson/test_cityjson.py"),
    *("twin/opendrive/test_opendrive.py", "ml/segmentation/test_task.py", "ml/centerline/test_task.py"),
    *("packaging/test_docs.py", "packaging/test_imports.py", "judges/test_judges.py"),
)
"""Files that are tested first: one of them last would leave the other process without work for as long as it takes."""
