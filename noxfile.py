"""Sessions of nox behind `make demo`, `make test` and the others: `nox -l` lists them.

`nox -s tests-3.11 -- tests/road -k curve` hands arguments to pytest. In the environment TEST_WORKERS=N sets how many
processes test side by side, TEST_MARKERS which tests, PYTHON that only the Python that runs nox is tested, EVERY_DOOR
that the doors are all run on both.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import sys
import time
from pathlib import Path

import nox
from nox.command import CommandFailed

BLENDER = {"3.11": "Blender 4.5 LTS", "3.13": "Blender 5.2 LTS"}
"""The Pythons that Blender is built for."""
HERE = f"3.{sys.version_info.minor}" if f"3.{sys.version_info.minor}" in BLENDER else "3.11"
"""The Python of all that isn't done on both: the one that runs nox."""
EXTRAS = {
    "demo": "blender",
    "docs": "docs",
    # `ml` on one Python only, as on Linux PyPI's torch comes with gigabytes of CUDA.
    "tests-3.11": "blender,dev,judges,ml,onnx",
    "tests-3.13": "blender,dev,judges",
}
"""Extras of pyproject.toml that are installed into each environment."""
BLENDER_TESTS = ("tests/blender", "tests/jobs", "tests/ui")
PARTS = {"blender": [*BLENDER_TESTS], "others": ["tests", *(f"--ignore={folder}" for folder in BLENDER_TESTS)]}
"""The tests in two processes: once ifcopenshell has worked in one, Blender 5.2's OBJ exporter aborts there."""
ALONE = ["-n", "0", "-m", "alone", *BLENDER_TESTS]
"""Arguments for the tests that measure the clock, which run after the others: slow ones, all of Blender."""
QUICK = "not slow and not fuzz and not cluster and not doors"
"""Marker expression of the tests of `make test`."""
SLOW = "slow"
"""That of `make test-slow`."""
ONLY = {("3.13", "blender"): "smoke or not any_blender", ("3.13", "others"): "smoke"}
"""Marker expressions by Python and part, where not all of a part's tests are run on that Python."""
LATER = {("3.13", "blender"): f"any_blender and not smoke and {QUICK}"}
"""Those of tests that `make test` leaves out on that Python, and `make test-slow` runs with the slow ones."""

KERNELS = "synthroads_addon/scanning/kernels/**/*.[ch]"
"""Sources that are compiled where the package is installed."""

DOOR_EXTRAS = {"3.11": ("ml", "twin", "e57", "maps", "cluster", "onnx", "changes"), "3.13": ()}
"""Extras that users add to what `make demo` makes, each tried alone: on one Python, as they don't depend on Blender."""

nox.needs_version = ">=2026.10"
nox.options.sessions = ["lint", "doors", "tests", "summary"]
nox.options.reuse_venv = "yes"
nox.options.download_python = "never"

outcomes: dict[str, str] = {}
"""Outcome of the tests by Python, and of the doors."""


def pyenv_folders(root: Path) -> list[str]:
    """Return where pyenv keeps these Pythons; its shims fail for those that it hasn't been told to use."""
    return [str(folder) for version in BLENDER for folder in sorted(root.glob(f"versions/{version}.*[0-9]/bin"))]


_PYENV = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv")
os.environ["PATH"] = os.pathsep.join([os.environ.get("PATH", ""), *pyenv_folders(_PYENV)])


def lock_of(name: str, python: str) -> str:
    """Return the path of the file with the versions and hashes of all that an environment holds, less PyTorch."""
    return f"tools/locks/{name.removesuffix(f'-{python}')}-{python}.txt"


def made_from(extras: str, root: Path) -> str:
    """Return all that an environment is made from: where the text has changed, it has to be brought up to date."""
    settings = nox.project.load_toml(root / "pyproject.toml")
    offered = settings["project"].pop("optional-dependencies")
    chosen = {extra: offered[extra] for extra in extras.split(",")}
    manifest = (root / "blender_manifest.toml").read_text(encoding="utf-8")
    package = [settings["build-system"], settings["project"], settings["tool"]["hatch"]]
    compiled = sorted([*root.glob("tools/build_kernels.py"), *root.glob(KERNELS)])
    kernels = [path.read_text(encoding="utf-8") for path in compiled]
    return json.dumps([str(root), chosen, package, manifest, kernels])


def install(session: nox.Session, name: str) -> None:
    """Bring a session's environment up to date; where nothing has changed that takes no time."""
    stamp, lock = Path(session.bin).parent / "synthroads-stamp", Path(lock_of(name, str(session.python)))
    wanted = made_from(EXTRAS[name], Path.cwd()) + lock.read_text(encoding="utf-8")
    if stamp.exists() and stamp.read_text(encoding="utf-8") == wanted:
        return
    stamp.unlink(missing_ok=True)
    session.log("The first time this downloads some 500 MB, for the tests more.")
    # Most of it is never compiled, as it is never imported. PyTorch isn't in the lock: the second call brings it.
    session.install("--no-compile", "--require-hashes", "--requirement", str(lock))
    # Where all is in the lock nothing else is brought: what the lock lacks the tests miss, before users do.
    others = [] if "ml" in EXTRAS[name].split(",") else ["--no-deps"]
    session.install("--no-compile", "--no-build-isolation", *others, "--editable", f".[{EXTRAS[name]}]")
    if "blender" in EXTRAS[name]:
        session.run_install("python", "tools/check_bpy.py")
    stamp.write_text(wanted, encoding="utf-8")


def python_of(session: nox.Session, name: str) -> str:
    """Bring another session's environment up to date and return its interpreter."""
    session.run(sys.executable, "-m", "nox", "--install-only", "--session", name)
    return f".nox/{name.replace('.', '-')}/bin/python"


@nox.session(python=[HERE])
def demo(session: nox.Session) -> None:
    """Make 600 m of motorway and scan it; arguments are those of `synthroads generate`."""
    install(session, "demo")
    link = Path(".venv")
    if link.is_symlink() or not link.exists():
        link.unlink(missing_ok=True)
        link.symlink_to(Path(session.bin).parent.relative_to(Path.cwd()))
    settings = ["--scenario", "rq31-600m", "--output", "out/demo", "--overwrite"]
    session.run("python", "-m", "headless.generate", *settings, *session.posargs, interrupt_timeout=10)


@nox.session(python=False)
def extension(session: nox.Session) -> None:
    """Build the Blender extensions: dist/*.zip."""
    session.run(python_of(session, f"demo-{HERE}"), "tools/build_extension.py", *session.posargs)


@nox.session(python=False)
def lint(session: nox.Session) -> None:
    """Check the source: ruff, who imports whom, types."""
    session.run(python_of(session, f"tests-{HERE}"), "tools/lint.py")  # with its PyTorch: one is large enough


@nox.session(python=False)
def quick(session: nox.Session) -> None:
    """Run the tests nearest to what changed against `main`; arguments are those of tools/quick_tests.py."""
    session.run(python_of(session, f"tests-{HERE}"), "tools/quick_tests.py", *session.posargs, interrupt_timeout=10)


@nox.session(python=False)
def weights(session: nox.Session) -> None:
    """Make the models that come with the package anew; arguments are those of tools/make_weights.py."""
    session.run(python_of(session, f"tests-{HERE}"), "tools/make_weights.py", *session.posargs)


@nox.session(python=False)
def judges(session: nox.Session) -> None:
    """Have the programs of others judge files of a small road, and print what they say."""
    session.run(python_of(session, f"tests-{HERE}"), "-m", "tests.judges", *session.posargs)


def pytest_runs(version: str, markers: str, arguments: list[str]) -> list[list[str]]:
    """Return what pytest is called with, once for each part; arguments that name tests are left as they are."""
    if any(argument.startswith("tests") for argument in arguments):
        return [arguments]
    only = {part: f"({ONLY[version, part]}) and " if (version, part) in ONLY else "" for part in PARTS}
    also = {part: f" or ({LATER[version, part]})" for part in PARTS if markers == SLOW and (version, part) in LATER}
    chosen = {part: f"{only[part]}({markers}) and not alone{also.get(part, '')}" for part in PARTS}
    runs = [["-m", chosen[part], *arguments, *paths] for part, paths in PARTS.items()]
    if markers == SLOW and version == min(BLENDER):
        runs.append([*arguments, *ALONE])
    return runs


def passed(codes: list[int], *, everything: bool) -> bool:
    """Say whether the tests passed by pytest's exit codes; a part may be empty (5) unless everything is to be run."""
    return 0 in codes and set(codes) <= ({0} if everything else {0, 5})


@nox.session(python=[HERE] if os.environ.get("PYTHON") else list(BLENDER))
def tests(session: nox.Session) -> None:
    """Run the tests; arguments are pytest's."""
    version = str(session.python)
    outcomes[version] = "FAILED, the environment could not be made"
    install(session, session.name)
    markers = os.environ.get("TEST_MARKERS") or QUICK
    # Without a limit on restarts a worker that crashes can leave the others waiting for ever.
    workers = ["-n", os.environ.get("TEST_WORKERS") or "2", "--dist", "loadfile", "--max-worker-restart", "0"]
    # The processes share the cores already; spinning threads of linear algebra would only slow each other down.
    environment: dict[str, str | None] = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    # Tests start hundreds of processes: where none kept its bytecode, each would compile all that it imports.
    environment["PYTHONDONTWRITEBYTECODE"] = None
    start, codes = time.perf_counter(), []
    for arguments in pytest_runs(version, markers, session.posargs):
        try:  # the other part is run also after one has failed
            session.run("python", "-m", "pytest", "-q", *workers, *arguments, env=environment, interrupt_timeout=10)
            codes.append(0)
        except CommandFailed as failure:
            codes.append(failure.return_code or 1)
    good = passed(codes, everything=markers == QUICK and not session.posargs)
    outcomes[version] = f"{'passed' if good else 'FAILED'}, {time.perf_counter() - start:.0f} s"
    if not good:
        raise CommandFailed(f"pytest ended with {codes}")


@nox.session(python=[HERE] if os.environ.get("PYTHON") else list(BLENDER))
def doors(session: nox.Session) -> None:
    """Run what users are shown, in environments as they make them; arguments are pytest's.

    On a second Python only what Blender's release changes, unless the environment's EVERY_DOOR is set.
    """
    version = str(session.python)
    every, again = bool(os.environ.get("EVERY_DOOR")), any(name.endswith(" doors") for name in outcomes)
    places: dict[str, str | bool | dict[str, str]] = {"every_door": every, "every_line": every or not again}
    outcomes[f"{version} doors"] = "FAILED, the environments could not be made"
    install(session, "demo")
    places["demo"] = str(Path(session.bin, "python").absolute())
    (bpy,) = re.findall(r"^bpy==[\w.]+", Path(lock_of("demo", version)).read_text(encoding="utf-8"), re.MULTILINE)
    places["bare"] = _door(session, "bare", bpy)
    # The package is built apart from what is installed once, for the wheel: each time that brings a compiler anew.
    added = ("--no-build-isolation", "--editable")
    places["extras"] = {extra: _door(session, extra, *added, f".[{extra}]", upon="") for extra in DOOR_EXTRAS[version]}
    shutil.rmtree("build/wheel", ignore_errors=True)
    session.run("python", "-m", "pip", "wheel", "-q", "--no-deps", "--wheel-dir", "build/wheel", ".")
    (wheel,) = Path("build/wheel").glob("*.whl")  # its name tells the version
    brought = "blender,ml" if "ml" in DOOR_EXTRAS[version] else "blender"
    places["wheel"] = _door(session, "wheel", f"{wheel.absolute()}[{brought}]", upon="bare")
    release = BLENDER[version].split()[1]
    session.run("python", "tools/build_extension.py", "--blender", release, "--output-dir", f"build/doors/{version}")
    places["zips"] = str(Path("build/doors", version).absolute())
    environment = {"SYNTHROADS_DOORS": json.dumps(places), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    runner = python_of(session, f"tests-{HERE}")  # pytest stays outside of what users have
    start = time.perf_counter()
    outcomes[f"{version} doors"] = "FAILED"
    words = ["-q", "-n", "2", "--dist", "loadfile", "-m", "doors", *(session.posargs or ["tests/doors"])]
    session.run(runner, "-m", "pytest", *words, env=environment, external=True, interrupt_timeout=10)
    outcomes[f"{version} doors"] = f"passed, {time.perf_counter() - start:.0f} s"


def _door(session: nox.Session, name: str, *requirements: str, upon: str | None = None) -> str:
    """Return the interpreter of an environment of `doors`, made anew where its requirements have changed.

    Args:
        session: that it is for.
        name: of the environment.
        requirements: arguments of pip's; a wheel by its path.
        upon: environment whose packages it has as well ("" is the session's own), so that Blender is installed twice
            and not ten times.
    """
    own = Path(session.bin).parent.absolute()
    folder = own.with_name(f"{own.name}-{name}")
    python, stamp = folder / Path(session.bin).name / "python", folder / "synthroads-stamp"
    hashes = [hashlib.sha256(path.read_bytes()).hexdigest() for path in Path("build/wheel").glob("*.whl")]
    extras = f"blender,{name}" if name in DOOR_EXTRAS[str(session.python)] else "blender"
    wanted = json.dumps([requirements, made_from(extras, Path.cwd()), hashes if name == "wheel" else []])
    if stamp.exists() and stamp.read_text(encoding="utf-8") == wanted:
        return str(python)
    session.run("python", "-m", "venv", "--clear", str(folder))
    if upon is not None:
        (packages,) = folder.glob("lib/python*/site-packages")
        below = own.with_name(f"{own.name}-{upon}" if upon else own.name) / packages.relative_to(folder)
        (packages / "upon.pth").write_text(f"import site; site.addsitedir({str(below)!r})\n", encoding="utf-8")
    session.run(str(python), "-m", "pip", "install", "-q", "--no-compile", *requirements, external=True)
    stamp.write_text(wanted, encoding="utf-8")
    return str(python)


@nox.session(python=HERE)
def docs(session: nox.Session) -> None:
    """Build the documentation: build/site/index.html."""
    install(session, "docs")
    # Whatever the generator complains of is a failure: a link that leads nowhere, a page that is missing or in no menu.
    strict = ["--jobs", "auto", "--fresh-env", "--fail-on-warning", "--quiet"]
    shutil.rmtree("docs/reference/api", ignore_errors=True)  # pages of modules that are no more, left by a run cut off
    session.run("python", "-m", "sphinx", *strict, "--doctree-dir", "build/doctrees", "docs", "build/site")
    session.log("built build/site/index.html")


@nox.session(python=HERE)
def lock(session: nox.Session) -> None:
    """Write the locks of the environments anew; `--check` only compares them."""
    session.install("uv>=0.13,<0.14", "nox>=2026.10,<2027", "packaging>=24")
    session.run("python", "tools/lock.py", *session.posargs)


@nox.session(python=False)
def summary(session: nox.Session) -> None:
    """Say what the tests came to; it is a failure if nothing was tested."""
    for version, blender in BLENDER.items():
        session.log(f"Python {version} ({blender}): {outcomes.get(version, 'NOT RUN')}")
        if f"{version} doors" in outcomes:
            session.log(f"Python {version}, as users have it: {outcomes[f'{version} doors']}")
    if not outcomes:
        session.error("nothing was tested: install Python 3.11 or 3.13")
