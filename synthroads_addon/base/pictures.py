"""Kinds of pictures that are opened, known by their first bytes: what a file of another kind holds is read by nobody.

Libraries of pictures take many more, among them such as they start a program for (EPS), or that name further files or
addresses of the network (lists of films).
"""

from pathlib import Path

PILLOW_FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "WEBP")
"""Formats, as Pillow calls them, of pictures that it may open."""
TEXTURE_KINDS = frozenset({"PNG", "JPEG", "OpenEXR", "TIFF"})
"""Kinds of which folders of textures are made."""

_SIGNATURES: tuple[tuple[bytes, str], ...] = (
    (b"\x89PNG\r\n\x1a\n", "PNG"),
    (b"\xff\xd8\xff", "JPEG"),
    (b"\x76\x2f\x31\x01", "OpenEXR"),
    *((sign, "TIFF") for sign in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")),
    (b"BM", "BMP"),
    *((sign, "HDR") for sign in (b"#?RADIANCE", b"#?RGBE")),
    *((sign, "JPEG 2000") for sign in (b"\0\0\0\x0cjP  \r\n", b"\xff\x4f\xff\x51")),
    (b"DDS ", "DDS"),
    (b"8BPS", "PSD"),
    *((sign, "DPX") for sign in (b"SDPX", b"XPDS")),
    (b"\x80\x2a\x5f\xd7", "Cineon"),
    (b"\x01\xda", "IRIS"),
)
_LONGEST = 18
_TARGA = frozenset({1, 2, 3, 9, 10, 11})
"""Types of Targa images, in the third byte: the format has no signature."""
KINDS = (*dict.fromkeys(kind for _, kind in _SIGNATURES), "WebP", "Targa")
"""Names of all kinds that are opened where Blender reads a picture."""


def picture_kind(path: Path) -> str | None:
    """Return the kind of picture that a file is by its first bytes, one of `KINDS`; None if of none.

    Raises:
        OSError: it can't be read.
    """
    with path.open("rb") as file:
        first_bytes = file.read(_LONGEST)
    for signature, kind in _SIGNATURES:
        if first_bytes.startswith(signature):
            return kind
    if first_bytes[:4] == b"RIFF" and first_bytes[8:12] == b"WEBP":
        return "WebP"
    if (
        path.suffix.lower() == ".tga"
        and len(first_bytes) == _LONGEST
        and first_bytes[1] in (0, 1)
        and first_bytes[2] in _TARGA
    ):
        return "Targa"
    return None
