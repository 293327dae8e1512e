"""Windows and macOS, as far as another system can tell: names of files, calls that only Unix has, text, wheels."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path, PurePosixPath

import pytest

from tools.build_extension import EXTENSIONS, PLATFORM_TAGS, RELEASES, read_wheel_list

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ("synthroads_addon", "headless", "ml")
LINUX_ALONE = {"headless/supervision.py"}
"""Files that are imported on Linux alone, see `headless/commands.py`."""
CALLED_FROM_THERE = {
    "headless/prompt_end.py": {"signal.pthread_sigmask", "signal.SIG_BLOCK"},  # its thread isn't begun on Windows
    "synthroads_addon/base/scratch/folders.py": {"os.pread"},
    "synthroads_addon/base/scratch/opened_file.py": {"os.pread"},
}
"""Calls that are made on Linux alone, by those files or after asking for the system elsewhere."""
FILES_OF_LINUX = {"synthroads_addon/base/machine.py", "synthroads_addon/base/scratch/locks.py", "ml/data/workers.py"}
"""Files that name folders and files of Linux, and do without them where they aren't there."""
RESERVED = re.compile(r"(?:con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³])(?:\..*)?", re.IGNORECASE)
"""Names that Windows keeps for devices, with any ending."""
FORBIDDEN = re.compile(r'[<>:"\\|?*\x00-\x1f]|[. ]$')
"""Characters that Windows allows in no name, and ends that it drops."""
LONGEST_PATH = 120
"""Longest path below the repository's folder; chosen: Windows allows 260 in all, and Blender's folder of extensions
takes about 110 of them."""
UNIX_MODULES = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}
UNIX_NAMES = {
    "os": {
        *("chown", "fchmod", "fchown", "fork", "forkpty", "geteuid", "getgid", "getgroups", "getloadavg", "getpgid"),
        *("getpriority", "getuid", "killpg", "memfd_create", "mkfifo", "mknod", "nice", "posix_fadvise", "pread"),
        *("sched_getaffinity", "sched_setaffinity", "setpriority", "setsid", "setuid", "statvfs", "sysconf", "uname"),
        *("wait3", "wait4", "O_NOFOLLOW", "O_DIRECTORY", "O_CLOEXEC", "WNOHANG"),
    },
    "signal": {
        *("SIGALRM", "SIGBUS", "SIGCHLD", "SIGHUP", "SIGKILL", "SIGPIPE", "SIGQUIT", "SIGSTOP", "SIGUSR1", "SIGUSR2"),
        *(
            "SIG_BLOCK",
            "SIG_SETMASK",
            "SIG_UNBLOCK",
            "alarm",
            "pthread_kill",
            "pthread_sigmask",
            "setitimer",
            "sigwait",
        ),
    },
    "time": {"tzset", "clock_getres", "clock_gettime"},
    "socket": {"AF_UNIX", "socketpair"},
}
"""Names of the standard library that Python for Windows lacks."""
UNIX_ARGUMENTS = {"preexec_fn", "pass_fds", "process_group", "umask"}
"""Arguments of `subprocess.Popen` that Windows refuses."""


def _committed() -> list[str]:
    answer = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False)
    if answer.returncode != 0:
        pytest.skip("no git checkout")
    return [name for name in answer.stdout.decode("utf-8").split("\0") if name]


def _faulty_names(names: list[str]) -> list[str]:
    """Return paths that Windows can't have, and those that it or macOS takes for another one."""
    lowered: dict[str, str] = {}
    faults = [
        name
        for name in names
        if len(name) > LONGEST_PATH
        or any(RESERVED.fullmatch(part) or FORBIDDEN.search(part) for part in PurePosixPath(name).parts)
    ]
    for name in names:
        for part in (name, *(str(folder) for folder in PurePosixPath(name).parents)):
            if lowered.setdefault(part.casefold(), part) != part:
                faults.append(part)
    return faults


def test_windows_and_macos_can_have_every_file() -> None:
    assert _faulty_names(_committed()) == []


@pytest.mark.parametrize(
    "name",
    [*("a/con", "a/Aux.py", "nul.tar.gz", "COM1", "a:b", "what?", "a/b.", "a /b", "x" * 121), "tab\t", 'say "a"'],
)
def test_names_that_windows_lacks_are_noticed(name: str) -> None:
    assert _faulty_names([name]) == [name]


def test_names_that_differ_by_case_are_noticed() -> None:
    assert _faulty_names(["docs/a.md", "Docs/b.md"]) == ["Docs"]
    assert _faulty_names(["a/b.md", "a/B.md", "a/console.md"]) == ["a/B.md"]


def _guarded_names(node: ast.AST) -> set[str]:
    """Return the names that a function or file asks for before it uses them, by `hasattr` or the system's name."""
    names = set()
    for part in ast.walk(node):
        if isinstance(part, ast.Call) and isinstance(part.func, ast.Name) and part.func.id in ("hasattr", "getattr"):
            names |= {item.value for item in part.args if isinstance(item, ast.Constant)}
        if isinstance(part, ast.Attribute) and ast.unparse(part) in ("sys.platform", "os.name"):
            names.add("*")
    return names


def _faulty_lines(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield the number and text of each line of a file that Windows can't run, or that depends on the locale there.

    A name that Windows lacks may stand in a function that asks for this name, or one that `hasattr` tells of the same
    family, or for the system; a module that it lacks may be imported in a function, with an answer to `ImportError` or
    after asking for the system.
    """
    yield from _faults_below(tree, set(), False)


def _faults_below(node: ast.AST, known: set[str], catches: bool) -> Iterator[tuple[int, str]]:
    for child in ast.iter_child_nodes(node):
        inner, inner_catches = known, catches
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.IfExp | ast.If):
            inner = known | _guarded_names(child)
        if isinstance(child, ast.Try):
            caught = " ".join(ast.unparse(one.type) for one in child.handlers if one.type)
            inner_catches = catches or "ImportError" in caught
            inner = known | {"*"} if "AttributeError" in caught else known
        if fault := _fault(child, inner, inner_catches):
            yield child.lineno, fault  # type: ignore[attr-defined]
        yield from _faults_below(child, inner, inner_catches)


def _fault(node: ast.AST, known: set[str], catches: bool) -> str:
    """Return what is wrong with one node of a file's tree; empty for nothing."""
    if isinstance(node, ast.Import | ast.ImportFrom):
        names = [node.module] if isinstance(node, ast.ImportFrom) else [item.name for item in node.names]
        if UNIX_MODULES & set(names) and not catches and "*" not in known:
            return ast.unparse(node)
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        lacking = UNIX_NAMES.get(node.value.id, set())
        if node.attr in lacking and "*" not in known and not known & lacking:
            return ast.unparse(node)
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and "*" not in known:
        return repr(node.value) if re.match(r"/(?:tmp|proc|dev|var|usr|home)(?:/|$)", node.value) else ""
    return _fault_of_call(node) if isinstance(node, ast.Call) else ""


def _fault_of_call(node: ast.Call) -> str:
    text, options = ast.unparse(node), {item.arg for item in node.keywords}
    name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    if name == "rename" and len(node.args) in (1, 2):  # Windows refuses to rename onto a file: `replace` does it
        return text
    if UNIX_ARGUMENTS & options:
        return text
    if name in ("run", "Popen", "check_output") and "text" in options and "encoding" not in options:
        return text
    if name == "write_text" and "encoding" not in options:
        return text
    is_method = isinstance(node.func, ast.Attribute)
    if (
        name in ("open", "fdopen", "NamedTemporaryFile")
        and "encoding" not in options
        and _is_text_mode(node, is_method)
    ):
        return text
    return ""


def _is_text_mode(node: ast.Call, is_method: bool) -> bool:
    """Return whether a call opens a file as text, as far as constants tell: methods by their mode alone."""
    modes = [item.value for item in node.args[: 1 if is_method else 2] if isinstance(item, ast.Constant)]
    modes += [item.value.value for item in node.keywords if item.arg == "mode" and isinstance(item.value, ast.Constant)]
    modes = [mode for mode in modes if isinstance(mode, str) and re.fullmatch(r"[rwxabt+]{1,3}", mode)]
    return not any("b" in mode for mode in modes) and (bool(modes) or not is_method)


def test_no_shipped_file_calls_what_only_unix_has() -> None:
    faults = []
    for path in sorted(path for part in SHIPPED for path in (ROOT / part).rglob("*.py")):
        name = path.relative_to(ROOT).as_posix()
        if name in LINUX_ALONE:
            continue
        for number, text in _faulty_lines(ast.parse(path.read_text(encoding="utf-8"))):
            is_known = name in FILES_OF_LINUX and text.startswith("'/")
            if not is_known and text not in CALLED_FROM_THERE.get(name, ()):
                faults.append(f"{name}:{number}: {text}")
    assert faults == []


@pytest.mark.parametrize(
    "line",
    [
        *("import fcntl", "from resource import getrlimit", "os.fork()", "signal.SIGKILL", "path.rename(other)"),
        *("os.rename(a, b)", "path.write_text(a)", "open(path)", 'path.open("w")', "run(line, text=True)"),
        *("Popen(line, preexec_fn=f)", "Path('/tmp/a')", "def f():\n  if hasattr(os, 'fsync'): os.getuid()"),
    ],
)
def test_a_call_that_only_unix_has_is_noticed(line: str) -> None:
    assert len(list(_faulty_lines(ast.parse(line)))) == 1


@pytest.mark.parametrize(
    "lines",
    [
        "try:\n  import resource\nexcept ImportError:\n  pass",
        "if sys.platform != 'win32':\n  import fcntl",
        "os.getuid() if hasattr(os, 'getuid') else 0",
        "def f():\n  if not hasattr(os, 'sched_setaffinity'): return\n  os.sched_getaffinity(0)",
        "path.open('rb')\nopen(path, 'wb')\npath.open('w', encoding='utf-8')\nImage.open(path)\npath.replace(other)",
    ],
)
def test_what_asks_first_is_allowed(lines: str) -> None:
    assert list(_faulty_lines(ast.parse(lines))) == []


LIBRARIES_NEED = {"O_CLOEXEC", "WNOHANG", "getuid", "statvfs", "sysconf", "uname"}
"""Names that libraries for Linux use without asking."""
LIKE_WINDOWS = f"""
import os, signal, sys
import asyncio, multiprocessing.context, subprocess, tarfile, tempfile  # the standard library has asked already
for name in {sorted(UNIX_MODULES - {"fcntl", "posix"})!r}:
    sys.modules[name] = None
for module, names in ((os, {sorted(UNIX_NAMES["os"] - LIBRARIES_NEED)!r}), (signal, {sorted(UNIX_NAMES["signal"])!r})):
    for name in names:
        if hasattr(module, name):
            delattr(module, name)
"""
"""Code after which Python lacks what it lacks on Windows, but for `fcntl`: locks ask for the system by its name."""


def _run_like_windows(code: str, folder: Path) -> str:
    code = f"{LIKE_WINDOWS}\nsys.path.insert(0, {str(ROOT)!r})\n{code}\nsys.stdout.flush()\nos._exit(0)"
    call = [sys.executable, "-X", "warn_default_encoding", "-c", code]
    answer = subprocess.run(call, cwd=folder, capture_output=True, text=True, encoding="utf-8", check=False)
    assert answer.returncode == 0, answer.stderr
    ours = [line for line in answer.stderr.splitlines() if "EncodingWarning" in line and str(ROOT / "synth") in line]
    assert not ours, answer.stderr
    return answer.stdout


@pytest.mark.parametrize("package", SHIPPED)
def test_every_module_is_imported_without_what_windows_lacks(package: str, tmp_path: Path) -> None:
    for library in {"synthroads_addon": ("bpy",), "headless": (), "ml": ("torch",)}[package]:
        pytest.importorskip(library)
    paths = sorted((ROOT / package).rglob("*.py"))
    names = [path.relative_to(ROOT).as_posix() for path in paths]
    names = [name for name in names if name not in LINUX_ALONE and not name.endswith("__main__.py")]
    modules = [name.removesuffix(".py").removesuffix("/__init__").replace("/", ".") for name in names]
    code = f"import importlib\nfor name in {modules!r}:\n    importlib.import_module(name)\nprint('imported')"
    assert "imported" in _run_like_windows(code, tmp_path)


def test_a_road_is_made_and_scanned_without_what_windows_lacks(tmp_path: Path) -> None:
    """In a folder with a space, umlauts and a sign that no code page of Windows has."""
    pytest.importorskip("bpy")
    folder = tmp_path / "Straße über den Fluß ☃"
    folder.mkdir()
    code = """
from headless.cli import main
draft = ["--fidelity", "draft"]
size = ["--set", "road.length=60", "--set", 'outputs=["parameters","scene","cloud"]']
assert main(["generate", "--output", "Neue Straße", "--seed", "7", *draft, *size]) == 0
device = ["--device", "velodyne-hdl-64e"]
assert main(["scan", "Neue Straße/scene.blend", "--output", "Zweite Messung", *draft, *device]) == 0
assert main(["cloud", "info", "Neue Straße/cloud.laz"]) == 0
assert main(["twin", "Neue Straße/parameters.json", "--output", "Zwilling für alle"]) == 0
assert main(["check", "Neue Straße/parameters.json"]) == 0
"""
    _run_like_windows(code, folder)
    names = [path.relative_to(folder).as_posix() for path in folder.rglob("*")]
    assert "Neue Straße/cloud.laz" in names
    assert "Zweite Messung/cloud.laz" in names
    assert _faulty_names(names) == []


@pytest.mark.slow
@pytest.mark.parametrize("target", PLATFORM_TAGS)
def test_every_platform_has_wheels_of_the_locked_versions(target: str, tmp_path: Path) -> None:
    """Pip finds them by tags alone; nothing is downloaded but what a wheel says of itself."""
    for release, extension in product(RELEASES, EXTENSIONS):
        if target not in release.platforms:
            continue
        command = [
            *(sys.executable, "-m", "pip", "install", "--dry-run", "--ignore-installed", "--quiet", "--no-deps"),
            *("--report", str(tmp_path / "report.json"), "--target", str(tmp_path / "nothing")),
            *("--only-binary=:all:", "--implementation", "cp", "--python-version", release.python),
            *(word for tag in PLATFORM_TAGS[target] for word in ("--platform", tag)),
            *read_wheel_list(extension.wheel_list),
        ]
        answer = subprocess.run(command, capture_output=True, text=True, encoding="utf-8", check=False)
        assert answer.returncode == 0, answer.stderr
        report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
        locked = extension.lock.read_text(encoding="utf-8")
        for entry in report["install"]:
            address = entry["download_info"]["url"]
            tags = PurePosixPath(address).name.removesuffix(".whl").split("-")[-1].split(".")
            assert "any" in tags or set(tags) & set(PLATFORM_TAGS[target]), address
            assert entry["download_info"]["archive_info"]["hashes"]["sha256"] in locked, address
