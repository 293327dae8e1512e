"""The compiled kernels: for all platforms from one source, the same bytes each time; in wheels and checkouts."""

from __future__ import annotations

import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from noxfile import made_from
from synthroads_addon.scanning.kernels.library import FOLDER
from tools import build_kernels as builder
from tools.build_kernels import KERNELS, TARGETS, KernelError, KernelHook, build_kernels, this_platform

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted(path.stem for path in FOLDER.glob("*.c"))
KINDS = {"linux-x64": b"\x7fELF\x02", "windows-x64": b"MZ", "macos-arm64": b"\xcf\xfa\xed\xfe\x0c\x00\x00\x01"}
"""First bytes of each platform's libraries."""

pytestmark = pytest.mark.first_python


class _App:
    def __init__(self) -> None:
        self.warnings: list[str] = []

    def display_warning(self, text: str) -> None:
        self.warnings.append(text)


class _Hook(KernelHook):
    """The hook without hatchling around it."""

    def __init__(self) -> None:
        self.told = _App()

    @property
    def app(self) -> _App:
        return self.told


@pytest.mark.parametrize("target", TARGETS)
def test_every_platforms_libraries_are_compiled_anywhere_to_the_same_bytes(target: str, tmp_path: Path) -> None:
    made = [build_kernels(target, tmp_path / part) for part in ("one", "two")]
    assert [path.name.removesuffix(path.suffix) for path in made[0]] == [f"{name}-{target}" for name in SOURCES]
    for first, second in zip(*made, strict=True):
        content = first.read_bytes()
        assert content.startswith(KINDS[target])
        assert content == second.read_bytes()
        assert len(content) < 100_000
        assert str(Path.home()).encode() not in content
        assert str(ROOT).encode() not in content


def test_a_kernel_that_is_wrong_is_refused_and_where_it_is_installed_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "wrong.c").write_text("int half(int a) { return a +; }\n", encoding="utf-8")
    monkeypatch.setattr(builder, "KERNELS", tmp_path)
    with pytest.raises(KernelError, match=r"wrong\.c wasn't compiled for x86_64-linux"):
        build_kernels("linux-x64", tmp_path)
    hook = _Hook()
    hook.initialize("editable", {})
    assert len(hook.told.warnings) == 1
    assert hook.told.warnings[0].startswith("SynthRoads works without its kernels, and slower: wrong.c wasn't compiled")
    assert [path.name for path in tmp_path.iterdir()] == ["wrong.c"]


def test_what_was_compiled_is_taken_until_source_options_or_compiler_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled: list[str] = []

    def compile_(source: Path, triple: str, name: str) -> bytes:
        compiled.append(name)
        return source.read_bytes()

    monkeypatch.setattr(builder, "KERNELS", tmp_path)
    monkeypatch.setattr(builder, "_compile", compile_)
    source, kept = tmp_path / "half.c", tmp_path / "kept"

    def built(target: str = "linux-x64") -> int:
        """Build into a new folder; return how many sources were compiled for it."""
        compiled.clear()
        (library,) = build_kernels(target, tmp_path / "libraries", kept)
        assert library.read_bytes() == source.read_bytes()
        library.unlink()
        return len(compiled)

    source.write_text('#include "half.h"\n', encoding="utf-8")
    (tmp_path / "half.h").write_text("int half(int);\n", encoding="utf-8")
    assert [built(), built(), built("windows-x64"), built()] == [1, 0, 1, 0]
    (tmp_path / "half.h").write_text("long half(long);\n", encoding="utf-8")
    assert [built(), built()] == [1, 0]
    source.write_text('#include "half.h"\nint more;\n', encoding="utf-8")
    assert [built(), built()] == [1, 0]
    monkeypatch.setitem(TARGETS, "linux-x64", ("x86_64-linux-gnu.2.28", "so"))
    assert [built(), built()] == [1, 0]
    monkeypatch.setattr(builder, "_OPTIONS", ("-O3",))
    assert [built(), built()] == [1, 0]
    monkeypatch.setattr(builder, "version", lambda name: "0.99")
    assert [built(), built()] == [1, 0]
    assert len(build_kernels("linux-x64", tmp_path / "libraries")) == len(compiled) == 1, "without a folder all is"


def test_without_the_compiler_it_is_installed_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(builder, "find_spec", lambda name: None)
    hook = _Hook()
    hook.initialize("editable", {})
    (warning,) = hook.told.warnings
    assert warning.endswith("and slower: the compiler isn't installed: pip install 'ziglang>=0.17,<0.18'")


@pytest.mark.parametrize(("version", "targets"), [("standard", [*TARGETS]), ("editable", [this_platform()])])
def test_wheels_have_all_platforms_and_what_is_edited_its_own(
    version: str, targets: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    built: list[str] = []
    monkeypatch.setattr(builder, "build_kernels", lambda target, **_: built.append(target))
    _Hook().initialize(version, {})
    assert built == targets
    monkeypatch.setattr(builder, "this_platform", lambda: "linux-arm64")
    _Hook().initialize("editable", {})
    assert built == targets  # there is no Embree 4 for it: nothing to compile, and nothing to warn of


def test_the_wheel_holds_sources_and_libraries(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    answer = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
    (wheel,) = tmp_path.glob("*.whl")
    assert wheel.name.endswith("-py3-none-any.whl")
    with zipfile.ZipFile(wheel) as content:
        names = set(content.namelist())
    folder = KERNELS.relative_to(ROOT).as_posix()
    assert f"{folder}/kernel.h" in names
    for name in SOURCES:
        assert f"{folder}/{name}.c" in names
        for target, (_, suffix) in TARGETS.items():
            assert f"{folder}/{name}-{target}.{suffix}" in names


def test_environments_are_made_anew_when_a_kernel_has_changed(tmp_path: Path) -> None:
    settings = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    (tmp_path / "pyproject.toml").write_text(settings, encoding="utf-8")
    for path in (ROOT / "blender_manifest.toml", ROOT / "tools" / "build_kernels.py", FOLDER / "packets.c"):
        copy = tmp_path / path.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    before = made_from("blender", tmp_path)
    assert made_from("blender", tmp_path) == before
    source = tmp_path / FOLDER.relative_to(ROOT) / "packets.c"
    source.write_text("int other;\n", encoding="utf-8")
    assert made_from("blender", tmp_path) != before


def test_the_compiler_that_is_named_is_the_one_that_builds() -> None:
    requires = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]
    assert any(line.startswith("ziglang>=0.17,<0.18;") for line in requires)
