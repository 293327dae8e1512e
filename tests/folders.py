"""Which folders of tests need Blender, which have a process of their own, and which files take longest."""

from __future__ import annotations

BLENDER_TESTS = ("blender", "jobs", "ui")

LONG_FILES = (
    *("jobs/test_dataset.py", "jobs/measure/test_tradeoff.py", "blender/model/test_road_variants.py"),
    *("jobs/test_kills.py", "jobs/scan/test_long_road.py", "jobs/test_panoptic.py", "blender/model/test_stretches.py"),
    *("jobs/test_scan_scene.py", "blender/cameras/test_cameras.py", "ui/work/test_rendered_scan.py"),
    *("jobs/scan/test_by_section.py", "jobs/choose/test_search.py", "ui/work/test_build.py"),
    *("blender/nodes/test_nodes.py", "blender/views/test_gallery.py", "jobs/test_faults.py", "jobs/test_generate.py"),
    *("blender/model/test_every_class.py", "ui/work/test_scan.py", "ui/panels/test_calibration.py"),
    *("blender/model/test_build.py", "ui/panels/test_road_files.py", "ui/panels/test_export.py"),
    *("robustness/test_endurance.py", "ml/segmentation/test_learning.py", "twin/test_trace.py"),
    *("twin/ifc/test_ifc.py", "packaging/test_extension.py", "fitting/test_fit.py", "twin/opendrive/test_opendrive.py"),
    *("twin/cityjson/test_cityjson.py", "ml/centerline/test_task.py", "ml/segmentation/test_task.py"),
    *("judges/test_judges.py", "sampling/test_road.py", "sampling/test_section.py", "scanning/platforms/test_path.py"),
    *("headless/test_reconstruct.py", "packaging/test_docs.py", "packaging/test_imports.py"),
    *("twin/ifc/test_readers.py", "reconstruction/test_judgement.py", "scanning/scene/test_motion.py"),
)
"""Files that are tested first: one of them last would leave the other process without work for as long as it takes."""
