"""Statistics of a cloud as text, for `synthroads cloud info`."""

from typing import Any

from synthroads_addon.base.text.table import text_table

_COLUMNS = (
    ("points", "points", "{:,}"),
    ("density", "1/m2", "{:.1f}"),
    ("height_mean", "height m", "{:.2f}"),
    ("height_std", "std", "{:.2f}"),
    ("roughness", "roughness", "{:.4f}"),
    ("intensity_mean", "intensity", "{:.3f}"),
    ("intensity_std", "std", "{:.3f}"),
    ("luminance_mean", "luminance", "{:.3f}"),
    ("luminance_std", "std", "{:.3f}"),
)


def table(figures: dict[str, Any]) -> str:
    """Return a cloud's statistics as text: extent, attributes, and a table of figures by class."""
    lines = [f"{figures['file']}: {figures['kind']}, {figures['points']:,} points"]
    system = figures["coordinate_system"]
    lines.append(f"coordinate system {system or 'not named: coordinates are read as metres'}")
    if system and figures["height_epsg"] is None:
        lines.append("vertical coordinate system not named")
    if figures["bounds"]:
        lowest, highest = figures["bounds"]["low"], figures["bounds"]["high"]
        spans = " x ".join(f"{b - a:.1f}" for a, b in zip(lowest, highest, strict=True))
        lines.append(f"from {lowest} to {highest}: {spans} m")
    lines.append(f"further attributes: {', '.join(figures['attributes']) or 'none'}")
    if figures["left_out"]:
        lines.append(f"not read: {', '.join(figures['left_out'])}")
    rows = [("", *(title for _, title, _ in _COLUMNS))]
    for name, values in {"all": figures["all"], **figures["classes"]}.items():
        if values:
            cells = (form.format(values[key]) if values[key] is not None else "-" for key, _, form in _COLUMNS)
            rows.append((name, *cells))
    lines += text_table(rows[0], rows[1:], range(1, len(rows[0])))
    return "\n".join([*lines, *_predicted_lines(figures)])


def _predicted_lines(figures: dict[str, Any]) -> list[str]:
    """Return the lines on a cloud's predicted classes, and how they agree with its own; none where there are none."""
    if "predicted_classes" not in figures:
        return []
    agreement = figures["agreement"]
    ious = agreement["iou"] if agreement else {}
    rows = [
        (name, f"{row['points']:,}", f"{row['share']:.1%}", f"{ious[name]:.3f}" if name in ious else "-")
        for name, row in figures["predicted_classes"].items()
    ]
    titles = ("predicted_class", "points", "share", f"IoU with {figures['class_field']}")
    columns = len(titles) if agreement else len(titles) - 1
    lines = ["", *text_table(titles[:columns], [row[:columns] for row in rows], range(1, columns))]
    if agreement and agreement["share"] is not None:
        agreement_text = (
            f"{figures['class_field']}: the same class for {agreement['share']:.1%} of {agreement['points']:,} points"
        )
        lines.append(f"beside the cloud's own {agreement_text}")
    return lines
