"""Messages where Blender's Python package doesn't load."""

from __future__ import annotations

from tools.check_bpy import install_advice, missing_libraries


def test_missing_system_libraries_are_named_with_their_packages() -> None:
    libraries = missing_libraries(
        "\tlibXi.so.6 => not found\n\tlibm.so.6 => /lib/x86_64-linux-gnu/libm.so.6 (0x00007f0000000000)\n"
        "\tlibSM.so.6 => not found\n\tlibodd.so.1 => not found\n\tlibXi.so.6 => not found\n"
    )
    assert libraries == ["libXi.so.6", "libSM.so.6", "libodd.so.1"]
    text = install_advice(libraries)
    assert "sudo apt install libsm6 libxi6\n" in text
    assert text.endswith("libodd.so.1")
